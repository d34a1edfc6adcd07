# `make check` is the one command: CI calls the same.
PYTHON ?= python3
PYTEST ?= $(PYTHON) -m pytest

.PHONY: check lint types layers test slow bench format install demo-drive clean-cache

check: lint types layers test

lint:
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .

types:
	$(PYTHON) -m mypy

layers:
	$(PYTHON) -c "import sys; from importlinter.cli import lint_imports_command; sys.exit(lint_imports_command())"

test:
	$(PYTEST) -n 2

slow:
	$(PYTEST) -n 2 -m slow

# Every kind of attack against every detector, in a minute; see docs/benchmark.md.
bench:
	$(PYTHON) -c "from belie.cli.main import app; app()" bench quick -o $(or $(RESULTS),results) --reports 1

format:
	$(PYTHON) -m ruff format .
	$(PYTHON) -m ruff check --fix .

install:
	$(PYTHON) -m pip install -e '.[dev]'

# numba notices a change of the file that it compiled, but not of another whose functions it calls.
clean-cache:
	find src -name '*.nb[ci]' -delete

# The recording in the package that `belie demo` attacks; needs moderngl and EGL.
DEMO = src/belie/cli/demo_drive.mcap
demo-drive:
	$(PYTHON) -c "from belie.cli.main import app; app()" simulate demo --jpeg-quality 60 --force -o $(DEMO)
	rm -f $(DEMO).*
