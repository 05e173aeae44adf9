PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DOCS_STAMP := $(VENV)/.docs-installed
PIP_INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check
# Hashes of all files of a version, for every platform and Python from 3.11 on; a tool for the documentation needs 3.11.5.
UV ?= uv
LOCK = $(UV) pip compile --quiet --no-config --universal --generate-hashes --no-annotate \
  --constraint constraints.txt --custom-compile-command 'make lock'

# Tests start some hundred processes: each would compile the package again if compiled files were not kept.
unexport PYTHONDONTWRITEBYTECODE
# Each process that runs tests has a core of its own: threads of BLAS would take a third more processor time, those of
# Polars a tenth.
fast pytest coverage: export OPENBLAS_NUM_THREADS = 1
fast pytest coverage: export POLARS_MAX_THREADS = 1
# Memory that Polars frees goes back to the system: a process that runs tests would keep a quarter more.
fast pytest coverage: export _RJEM_MALLOC_CONF = dirty_decay_ms:500,muzzy_decay_ms:0

STATISTICS := block_moments blocks conditions counts curves grouping histogram increments log_histogram moments \
  outliers places pose_differences populations ratios samples trimming upright windows
FAST := tests/geometry tests/inference $(STATISTICS:%=tests/statistics/test_%.py) tests/tables tests/exceptions \
  tests/test_structure.py tests/test_atomic.py tests/test_printable.py tests/test_toml_text.py \
  tests/documents/test_commands.py

.PHONY: demo check fast test pytest coverage wheel bench docs lint clean install lock

demo: $(STAMP)
	$(BIN)/tracknoise demo

# What changes often breaks, in under a minute: lint beside a few hundred quick tests.
check: $(STAMP)
	$(MAKE) --no-print-directory --jobs 2 lint fast

fast: $(STAMP)
	$(BIN)/python -m pytest --quiet $(FAST)

# Lint beside all tests: without what it keeps between runs, mypy takes a minute on one core.
test: $(STAMP)
	$(MAKE) --no-print-directory --jobs 2 lint pytest

pytest: $(STAMP)
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal

coverage: $(STAMP)
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal --cov

wheel:
	PYTHON=$(PYTHON) .ci/wheel

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/oxlint --deny-warnings src/tracknoise/report/template

bench: $(STAMP)
	$(BIN)/python -m benchmarks

docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

install: $(STAMP)

lock:
	echo 'hatchling>=1.25' | $(LOCK) --python-version 3.11 --output-file locks/build.txt -
	$(LOCK) --python-version 3.11 --output-file locks/package.txt pyproject.toml
	$(LOCK) --python-version 3.11 --extra dev --output-file locks/dev.txt pyproject.toml
	$(LOCK) --python-version 3.11.5 --extra docs --output-file locks/docs.txt pyproject.toml

$(STAMP): pyproject.toml locks/dev.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "tracknoise needs Python 3.11 or newer; set PYTHON=...")'
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV)
	$(PIP_INSTALL) --no-deps --require-hashes --requirement locks/dev.txt
	$(PIP_INSTALL) --no-deps --no-build-isolation --editable .
	touch $@

$(DOCS_STAMP): $(STAMP) locks/docs.txt
	$(PIP_INSTALL) --no-deps --require-hashes --requirement locks/docs.txt
	touch $@

clean:
	rm -rf $(VENV) runs site dist .coverage .coverage.* .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks
	rm -rf .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
