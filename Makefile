PYTHON ?= python3
VENV   := .venv
RUN    := $(VENV)/bin/python -m
BUILD  := build
OLDEST := $(BUILD)/oldest
# What make mesh installs beside the package, of the optional dependencies in pyproject.toml.
EXTRAS ?= plot
INSTALLED := $(VENV)/.installed-$(EXTRAS)
# A worker that has nothing left takes tests from the other one. Bytecode is kept even where the environment forbids it:
# every worker would compile all tests anew, and every process that a test starts all of gtb_cli.
PYTEST := -m pytest -n auto --dist worksteal
test test-all test-oldest: export PYTHONDONTWRITEBYTECODE :=
SPECS   = $(wildcard specs/*.toml specs/*.json)
SOURCES = gtb_cli tests

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup mesh test test-all test-oldest lint types check specs golden reference gallery browser bench fuzz readers playground clean

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(VENV)/.development ## make .venv with everything for users and developers

mesh: $(INSTALLED) ## mesh specs/pentagon.toml, and say where the mesh is
	@mkdir -p $(BUILD)
	@$(RUN) gtb_cli mesh specs/pentagon.toml -o $(BUILD)/pentagon.obj
	@echo "The mesh is $(CURDIR)/$(BUILD)/pentagon.obj, made by: $(VENV)/bin/gtb mesh specs/pentagon.toml -o $(BUILD)/pentagon.obj"
	@echo "Type next: . $(VENV)/bin/activate"
	@echo "           gtb new bowl 5 -o bowl.toml && gtb view bowl.toml --thickness 2 --watch"

test: $(VENV)/.development ## run the quick tests, in some 100 s on two cores
	@$(VENV)/bin/python $(PYTEST) -m "not long"

test-all: $(VENV)/.development ## run all tests: also killed processes, extra seeds, every example, large models
	@$(VENV)/bin/python $(PYTEST)

test-oldest: $(OLDEST)/.installed ## run the quick tests with the oldest versions that pyproject.toml allows
	@$(OLDEST)/bin/python $(PYTEST) -m "not long"

lint: $(VENV)/.development ## check style and format
	@$(RUN) ruff check $(SOURCES)
	@$(RUN) ruff format --check $(SOURCES)

types: $(VENV)/.development ## check types
	@# Two workers take two thirds of the time where nothing is cached; older versions of mypy ignore the variable.
	@# On a busy machine they may not answer in time: that is status 2, as no error in types is.
	@MYPY_NUM_WORKERS=2 $(RUN) mypy || { [ $$? -eq 2 ] && $(RUN) mypy; }

check: lint types test-all ## lint, types and test-all: what must hold for every change

specs: $(INSTALLED) ## mesh every spec of specs/ into build/specs
	@$(RUN) gtb_cli mesh $(SPECS) -o $(BUILD)/specs -j 2

golden: $(INSTALLED) ## mesh every spec of specs/ into tests/golden, after a change that is meant
	@$(RUN) gtb_cli mesh $(SPECS) -n 3 -o tests/golden

reference: $(VENV)/.development ## make the reference of specs/PYTHON.md anew from the docstrings
	@$(RUN) tests.tools.python_page

gallery: $(VENV)/.development ## draw the pictures of specs/README.md and GUIDE.md anew, after a change that is meant
	@$(RUN) tests.tools.gallery

browser: $(VENV)/.development ## let Debian's Chromium and Firefox, those that are installed, show pages of gtb view and gtb diff
	@{ { command -v chromium && command -v chromedriver; } || { command -v firefox-esr && command -v Xvfb; }; } >/dev/null \
	|| { echo "expected a browser: apt-get install chromium chromium-driver, or firefox-esr xvfb libgl1-mesa-dri"; exit 2; }
	@$(RUN) pytest tests/pages/test_browser.py tests/review/test_browser.py

bench: $(BUILD)/bench/.installed ## measure times beside floors and peers, as a table of ratios; installs 1 GB below build
	@OPENBLAS_NUM_THREADS=1 $(BUILD)/bench/bin/python -m tests.benchmarks

fuzz: $(VENV)/.development ## 20,000 mutated specs, 2,000 files of each format imported, 5,000 models and command lines, 1,200 kills
	@$(RUN) tests.tools.fuzz

readers: $(INSTALLED) ## let 12 programs and libraries read every kind of mesh file; installs 5 GB below build
	@$(RUN) tests.tools.readers

playground: $(VENV)/.development ## make build/playground: static files with which anyone can try gtb in a browser
	@$(RUN) tests.tools.playground $(BUILD)/playground && echo "$(BUILD)/playground: put it on any server of files, or run python3 -m http.server -d $(BUILD)/playground"

clean: ## remove what was built; .venv stays
	rm -rf $(BUILD) .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find $(SOURCES) -name __pycache__ -type d -exec rm -rf {} +

# The stamps are newer than pyproject.toml where nothing has to be installed again.
$(INSTALLED): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "gtb needs Python 3.11 or later: make PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)
	@# Groups of dependencies, below, are known to pip from 25.1 on.
	$(RUN) pip install -qq --disable-pip-version-check --upgrade 'pip>=25.1'
	@# To compile all of scipy takes longer than to install it: a first picture compiles what it imports, if it can.
	$(RUN) pip install -qq --disable-pip-version-check --no-compile --editable '.[$(EXTRAS)]'
	@$(RUN) compileall -q gtb_cli
	@PYTHONDONTWRITEBYTECODE= $(RUN) gtb_cli plot specs/pentagon.toml -q >/dev/null 2>&1 || true
	@touch $@

# Each dependency is installed at its lower bound; what only tests need is the newest.
$(OLDEST)/.installed: pyproject.toml
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install -qq --disable-pip-version-check --upgrade 'pip>=25.1'
	@$(PYTHON) -c 'import tomllib; project = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
	print(*project["dependencies"], *sum(project["optional-dependencies"].values(), []), sep="\n")' \
	| sed 's/>=/==/' > $(OLDEST)/bounds.txt
	$(OLDEST)/bin/python -m pip install -qq --disable-pip-version-check --constraint $(OLDEST)/bounds.txt --editable . --group test
	@touch $@

# Tests do not need what is only measured beside; what cannot be had is a line of the table that says so.
$(BUILD)/bench/.installed: pyproject.toml
	$(PYTHON) -m venv $(BUILD)/bench
	$(BUILD)/bench/bin/python -m pip install -qq --disable-pip-version-check --editable .
	@$(PYTHON) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["dependency-groups"]["bench"], sep="\n")' \
	| while read peer; do \
	$(BUILD)/bench/bin/python -m pip install -qq --disable-pip-version-check --only-binary :all: "$$peer" </dev/null \
	|| echo "not installed: $$peer"; done
	@touch $@

$(VENV)/.development: $(INSTALLED)
	@# What of these is imported is compiled then.
	$(RUN) pip install -qq --disable-pip-version-check --no-compile --group test --group dev
	@touch $@
