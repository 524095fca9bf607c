# Two commands matter: `make demo` and `make test`. Both set up what they need in this folder.

# The first Python on this machine that is new enough.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin

.PHONY: demo test lint types pytest notebooks fmus clean

demo: .venv/installed
	@$(BIN)/falsifier run AT1 --out runs/demo-$$(date +%Y%m%d-%H%M%S); test $$? -eq 1

test: lint types pytest

lint: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/test
	$(BIN)/mypy

pytest: .venv/test .venv-export/installed
	$(BIN)/pytest

# Executes the notebooks and stores their outputs; the tests only execute them.
notebooks: .venv/test
	$(BIN)/python -m tests.notebooks

# Rebuilds every FMU in fmus/ from modelica/; the exporter has an environment of its own, because its parser and
# the monitor's want different versions of one library.
fmus: .venv-export/installed
	$(MAKE) -C modelica PYTHON=$(CURDIR)/.venv-export/bin/python fmus

.venv/installed: pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer with venv is needed: install it, or say make PYTHON=/path/to/python3"; exit 2; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

.venv/test: .venv/installed
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	@touch $@

.venv-export/installed: modelica/export/requirements.txt
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer with venv is needed: install it, or say make PYTHON=/path/to/python3"; exit 2; }
	$(PYTHON) -m venv .venv-export
	.venv-export/bin/pip install --quiet --disable-pip-version-check -r modelica/export/requirements.txt
	@touch $@

clean:
	rm -rf .venv .venv-export .mypy_cache .ruff_cache .pytest_cache .hypothesis runs
