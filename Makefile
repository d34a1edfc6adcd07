# `make check` is the one command: CI calls the same.
PYTHON ?= python3
PYTEST ?= $(PYTHON) -m pytest

.PHONY: check lint types layers test slow format install

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

format:
	$(PYTHON) -m ruff format .
	$(PYTHON) -m ruff check --fix .

install:
	$(PYTHON) -m pip install -e '.[dev]'
