# What there is: make demo, make test, make test-full, make test-lowest, make docs, make bench, make images,
# make clean.
# All they need is python3 (3.11 or later) with its venv module; the rest goes to .venv.

VENV := .venv
PYTHON := $(VENV)/bin/python
LOWEST := .venv-lowest
TESTED := gtval validation survey vision_gt laser_gt rtk_gt data_samples tests benchmarks docs examples

# One thread a process: the tests run side by side, and small matrices gain nothing from more.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

# Installing takes minutes: pip shows what it does where a person watches, elsewhere it is quiet.
INSTALL = $(PYTHON) -m pip install --disable-pip-version-check $$(test -t 2 || echo --quiet)

.PHONY: demo test test-full test-lowest check-code check-wheel docs bench images clean

demo: $(VENV)/installed
	$(VENV)/bin/gtval demo

test: check-code check-wheel
	$(PYTHON) -m pytest -n 2 --dist loadgroup -m "not full"

test-full: check-code check-wheel
	$(PYTHON) -m pytest -n 2 --dist loadgroup

# The lowest versions that pyproject.toml promises, OpenCV 4 among them; `make test` has OpenCV 5.
test-lowest: $(LOWEST)/installed
	$(LOWEST)/bin/python -m pytest -n 2 -m "not full and not browser" --ignore=tests/docs --ignore=tests/gtval tests

check-code: $(VENV)/installed-for-tests
	$(PYTHON) -m ruff check $(TESTED)
	$(PYTHON) -m ruff format --check $(TESTED)
	$(PYTHON) -m mypy
	$(VENV)/bin/lint-imports --no-cache

# What users get is the wheel: the demo must run from it, far from this folder.
check-wheel: $(VENV)/installed-for-tests
	.ci/check-wheel $(PYTHON)

# Warnings are errors, and a name that leads nowhere is a warning. The tests build it, too.
docs: $(VENV)/installed-for-docs
	$(PYTHON) -m sphinx -W -n --keep-going -q -b html docs build/docs
	@echo "The site: build/docs/index.html"

# Each figure beside the last one kept in benchmarks/figures.json; --keep adds today's.
bench: $(VENV)/installed-for-tests
	$(PYTHON) benchmarks/kept.py

images: $(VENV)/installed
	$(PYTHON) docs/make_images.py
	$(PYTHON) docs/make_survey_images.py
	$(PYTHON) docs/make_explain_images.py
	$(PYTHON) docs/make_room_pictures.py
	$(PYTHON) docs/make_tutorial_images.py
	$(PYTHON) docs/make_time_images.py
	$(PYTHON) docs/make_outdoor_images.py

clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

# Installed editable, so that the commands always run the sources as they are.
$(VENV)/installed: pyproject.toml | $(VENV)/bin/python
	$(INSTALL) --editable .
	touch $@

$(VENV)/installed-for-tests: pyproject.toml tests/pinned.txt | $(VENV)/bin/python
	$(INSTALL) --constraint tests/pinned.txt --editable '.[test]'
	touch $@ $(VENV)/installed

$(VENV)/installed-for-docs: pyproject.toml | $(VENV)/bin/python
	$(INSTALL) --editable '.[docs]'
	touch $@ $(VENV)/installed

$(LOWEST)/installed: pyproject.toml tests/lowest.txt
	python3 -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint tests/lowest.txt --editable '.[web,bags,gnss]' pytest pytest-xdist hypothesis httpx evo pyproj pymap3d selenium jsonschema
	touch $@

$(VENV)/bin/python:
	python3 -m venv $(VENV)
