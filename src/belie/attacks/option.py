"""One option of an attack: its unit, its meaning, and how its text is read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from belie.attacks.timing import Timing
from belie.types import AttackError

OptionValue = float | int | str | bool | Timing | None
Form = Literal["number", "integer", "timing", "text", "flag", "choice"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One option of an attack.

    Parameters
    ----------
    name, meaning, unit : str
        As shown to the user; angles are in degrees.
    form : Form
        How its text is read.
    default : OptionValue
        None where the option may be left out, or must be given (`required`).
    choices : tuple of str
        What a ``choice`` may be; `synonyms` are read as the choice they name.
    above, least, most : float or None
        Bounds of a number: exclusive, inclusive, inclusive.

    Examples
    --------
    >>> Option(name="period", form="number", unit="s", meaning="of one cycle", above=0.0).read("2.5")
    2.5
    """

    name: str
    form: Form
    meaning: str
    unit: str = ""
    default: OptionValue = None
    required: bool = False
    choices: tuple[str, ...] = ()
    synonyms: tuple[tuple[str, str], ...] = ()
    above: float | None = None
    least: float | None = None
    most: float | None = None

    def read(self, text: str) -> OptionValue:
        """The value that `text` stands for.

        Raises
        ------
        AttackError
            Where it stands for none, in one line that says what would do.
        """
        try:
            value = self._parse(text.strip())
        except ValueError:
            raise AttackError(f"{self.name}={text!r}: expected {self._expected()}") from None
        if isinstance(value, Timing):
            self._check_bounds(text, value.value)
        elif self.form in ("number", "integer") and isinstance(value, int | float):
            self._check_bounds(text, value)
        return value

    def _parse(self, text: str) -> OptionValue:
        match self.form:
            case "number":
                number = float(text)
                if not math.isfinite(number):
                    raise ValueError(text)
                return number
            case "integer":
                return int(text)
            case "timing":
                return Timing.parse(text)
            case "flag":
                if text.lower() not in ("true", "false"):
                    raise ValueError(text)
                return text.lower() == "true"
            case "choice":
                choice = dict(self.synonyms).get(text, text)
                if choice not in self.choices:
                    raise ValueError(text)
                return choice
            case "text":
                if not text:
                    raise ValueError(text)
                return text

    def _check_bounds(self, text: str, value: float) -> None:
        low = (self.above is not None and value <= self.above) or (
            self.least is not None and value < self.least
        )
        if low or (self.most is not None and value > self.most):
            raise AttackError(f"{self.name}={text}: expected {self._expected()}")

    def _expected(self) -> str:
        words = {
            "number": "a number",
            "integer": "a whole number",
            "timing": "frames (100) or seconds (10.5s), not negative",
            "flag": "true or false",
            "choice": "one of " + ", ".join([*self.choices, *(word for word, _ in self.synonyms)]),
            "text": "a text",
        }[self.form]
        bounds = [
            f"{sign} {bound:g}"
            for sign, bound in ((">", self.above), (">=", self.least), ("<=", self.most))
            if bound is not None
        ]
        return " ".join([words, *([f"[{self.unit}]"] if self.unit else []), " and ".join(bounds)]).strip()
