# The main targets are `make demo` and `make test`. Both install what they need in this folder.

# The first Python on this machine that is recent enough.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
BIN := .venv/bin

.PHONY: demo test lint types pytest test-spawn docs notebooks fmus windows-worker clean

# `falsifier run` exits with 1 if it falsified the requirement, which is what the demo expects.
demo: .venv/installed
	@$(BIN)/falsifier run AT1 --out runs/demo-$$(date +%Y%m%d-%H%M%S); test $$? -eq 1

test: lint types pytest

lint: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/test
	$(BIN)/mypy
	$(BIN)/mypy --platform win32 --cache-dir .mypy_cache/win32 falsifier
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/darwin falsifier

pytest: .venv/test .venv-export/installed
	$(BIN)/pytest -n 2 --dist worksteal

# The tests of simulations again, with each FMU worker started as on systems without fork. Takes several minutes.
test-spawn: .venv/test
	FALSIFIER_WORKERS=spawn $(BIN)/pytest -n 2 --dist worksteal tests/fmu tests/evaluation tests/hostile tests/search \
		tests/problem tests/systems tests/counterexamples tests/campaigns

docs: .venv/test
	$(BIN)/mkdocs build --strict

# Executes the notebooks and stores their outputs; the tests only execute them.
notebooks: .venv/test
	$(BIN)/python -m tests.notebooks

# Rebuilds every FMU in fmus/ from modelica/. The exporter has its own environment, because pymoca and rtamt need
# different versions of the antlr runtime.
fmus: .venv-export/installed
	$(MAKE) -C modelica PYTHON=$(CURDIR)/.venv-export/bin/python fmus

# Rebuilds the program that runs Windows libraries through Wine, if its sources have changed.
windows-worker: .venv-export/installed
	$(MAKE) -C falsifier/fmu/windows_worker ZIG="$(CURDIR)/.venv-export/bin/python -m ziglang"

.venv/installed: pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer with venv is required; install it, or run make PYTHON=/path/to/python3"; exit 2; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

.venv/test: .venv/installed
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	@touch $@

.venv-export/installed: modelica/export/requirements.txt
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer with venv is required; install it, or run make PYTHON=/path/to/python3"; exit 2; }
	$(PYTHON) -m venv .venv-export
	.venv-export/bin/pip install --quiet --disable-pip-version-check -r modelica/export/requirements.txt
	@touch $@

clean:
	rm -rf .venv .venv-export build .mypy_cache .ruff_cache .pytest_cache .hypothesis runs
