# On a fresh machine with Python 3.11+ and make, `make run` installs everything and trains.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
# Drawing a picture of each job would take longer than training it.
EXPERIMENT := $(BIN)/python -m fnnq_torchrl.train hydra.launcher.pictures_up_to=0
SEEDS := 1000
GENERAL := sensitivity sensitivity_values best_exploration chain two_states
KILLS := 25
ROUNDS := 200
STEPS := 10
JAX := benchmarks/.jax
VMAS := benchmarks/.vmas
IRSIM := benchmarks/.irsim
STREAM := benchmarks/.streaming-drl
SB3 := benchmarks/peers/.venv
FOREIGN := tests/foreign/.venv
BROWSER := tests/browser/.venv
ONLY :=

unexport PYTHONDONTWRITEBYTECODE # with it, every process would compile all modules again

.DEFAULT_GOAL := help
.PHONY: help install run figures reproduction general-claims adaptive doya extrapolation rules memberships prior simulator textbook values stream-q test test-long foreign browser docs fuzz test-wheel bench bench-jax bench-loggers bench-worlds peers check-sb3 agreement random-driving torture soak lint format clean

help:  ## list these targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "make %-14s %s\n", $$1, $$2}' Makefile

install: $(STAMP)  ## everything into .venv, at the versions of constraints.txt (PYTHON=… picks the interpreter)

run: install  ## train 22 runs with λ = 0.2
	$(BIN)/python -m fnnq_torchrl.train lam=0.2 num_seeds=22
	@echo "to see one drive: $(BIN)/python -m fnnq_torchrl.watch run=$$(ls -td outputs/2* | head -n 1) situations=5 when=both"
	@echo "for a page with all results: $(BIN)/python -m fnnq_torchrl.report run=$$(ls -td outputs/2* | head -n 1)"

figures: install  ## the paper's figures and ours, 22 seeds each, into outputs/figures
	printf '%s\n' variants exploration traces decay fig2 fig3 | xargs -P 2 -I {} $(EXPERIMENT) +experiment={}
	$(BIN)/python -m fnnq_torchrl.figures fig2 fig3 traces readings decay exploration variants
	$(BIN)/python -m fnnq_torchrl.reproduction --short

reproduction: install  ## docs/reproduction.md: the paper's claims over 10,000 seeds (SEEDS=1000: seeds of the other experiments)
	for name in fig2_large fig3_large decay_large; do $(EXPERIMENT) +experiment=$$name || exit; done
	for name in traces decay exploration variants open_choices; do $(EXPERIMENT) +experiment=$$name num_seeds=$(SEEDS) || exit; done
	for name in $(GENERAL); do $(EXPERIMENT) +experiment=$$name || exit; done
	$(BIN)/python -m fnnq_torchrl.reproduction

general-claims: install  ## the second part of docs/reproduction.md alone: what the paper says of Q(λ) in general (takes some minutes)
	for name in $(GENERAL); do $(EXPERIMENT) +experiment=$$name || exit; done
	$(BIN)/python -m fnnq_torchrl.reproduction --general

adaptive: install  ## docs/adaptive.md and docs/meta_learning.md: adaptive parameters over 1,000 seeds (SEEDS=22: fewer)
	$(EXPERIMENT) +experiment=adaptive num_seeds=$(SEEDS)
	$(EXPERIMENT) +experiment=stability
	for name in step_sizes meta_step_sizes step_sizes_car; do $(EXPERIMENT) +experiment=$$name num_seeds=$(SEEDS) || exit; done
	$(BIN)/python -m fnnq_torchrl.adaptive
	$(EXPERIMENT) +experiment=doya num_seeds=10000
	for name in meta_learning changing_ball; do $(EXPERIMENT) +experiment=$$name num_seeds=$(SEEDS) || exit; done
	$(BIN)/python -m fnnq_torchrl.meta_learning

doya: install  ## meta-learning on the ring: the replication's table of stable solutions, 300 runs (takes three minutes)
	$(EXPERIMENT) +experiment=doya
	$(BIN)/python -m fnnq_torchrl.meta_learning --ring

extrapolation: install  ## docs/extrapolation.md: value functions at bearings that they have never seen; takes eight minutes
	for name in value_functions extrapolation; do $(EXPERIMENT) +experiment=$$name || exit; done
	$(BIN)/python -m fnnq_torchrl.extrapolation

rules: install  ## docs/rules.md: do distilled controllers catch what the learned ones catch, over 1,000 seeds?
	$(EXPERIMENT) num_seeds=$(SEEDS) hydra.run.dir=outputs/rules
	$(BIN)/python -m fnnq_torchrl.rules run=outputs/rules page=docs/rules.md

prior: install  ## docs/prior.md: what prior knowledge does to learning, over 1,000 seeds (takes three minutes)
	$(EXPERIMENT) +experiment=prior
	$(BIN)/python -m fnnq_torchrl.prior

simulator: install  ## docs/simulator.md: what is learned among obstacles, over 100 seeds (takes some minutes)
	$(EXPERIMENT) +experiment=simulator
	$(BIN)/python -m fnnq_torchrl.simulator

textbook: install  ## docs/textbook.md: figures of Sutton and Barto's book, 1,000 runs (takes some minutes)
	$(EXPERIMENT) +experiment=sutton_barto_12_10
	$(EXPERIMENT) +experiment=sutton_barto_12_11
	$(EXPERIMENT) +experiment=sutton_barto_12_6
	$(BIN)/python -m fnnq_torchrl.textbook

# The licence of the authors' program allows running it, but not a copy of it in this repository.
stream-q: install  ## docs/stream_q.md: Stream Q(λ), ours beside its authors' program, which git fetches
	-@test -d $(STREAM) || git clone -q https://github.com/mohmdelsayed/streaming-drl $(STREAM)
	-@git -C $(STREAM) checkout -q 407dca7
	$(EXPERIMENT) +experiment=stream_q
	$(EXPERIMENT) task=follow evaluation=none evaluation.every=20 situations=1000 num_seeds=100 hydra.run.dir=outputs/stream_q_fuzzy
	$(BIN)/python -m benchmarks.stream_q

values: install  ## docs/value_functions.md: value functions on the classic worlds, 100 seeds
	$(EXPERIMENT) +experiment=values_sweep
	$(EXPERIMENT) +experiment=values
	$(BIN)/python -m fnnq_torchrl.values

memberships: install  ## docs/memberships.md: are clustered labels better than those by hand, over 1,000 seeds (takes five minutes)
	$(EXPERIMENT) num_seeds=22 hydra.run.dir=outputs/visited
	$(EXPERIMENT) +experiment=memberships num_seeds=$(SEEDS)
	$(BIN)/python -m fnnq_torchrl.memberships

test: install  ## the test suite
	$(BIN)/python -m pytest -q -n auto --dist worksteal

test-long: install  ## the tests that take long, which make test leaves out
	$(BIN)/python -m pytest -q -n auto --dist worksteal -m long

foreign: install $(FOREIGN)/installed  ## what other programs make of our files of rules; says what is missing (ONLY='not octave': fewer)
	$(BIN)/python -m pytest -q -n auto -m foreign -k "$(ONLY)" tests/foreign

browser: install $(BROWSER)/installed  ## the pages of fnnq_torchrl.play and report in Chromium, which must be installed
	$(BIN)/python -m pytest -q -m browser tests/browser

docs: install $(VENV)/docs  ## the site of the documentation, into docs/_site
	$(BIN)/python -m sphinx -q -E -W --keep-going docs docs/_site

fuzz: install  ## thousands of random overrides, of which the test suite tries a few
	$(BIN)/python -m pytest -q tests/launch/test_bad_input.py -k overrides --hypothesis-profile long

test-wheel: install  ## before a release: check the distributions, install the wheel with downloaded dependencies, and train
	rm -rf dist && $(BIN)/python -m hatchling build
	$(PYTHON) -m venv dist/twine && dist/twine/bin/python -m pip install -qq twine
	dist/twine/bin/python -m twine check --strict dist/*.whl dist/*.tar.gz
	$(PYTHON) -m venv dist/empty
	dist/empty/bin/python -m pip install -qq -c constraints.txt dist/*.whl
	mkdir dist/elsewhere && cd dist/elsewhere && ../empty/bin/python -m fnnq_torchrl.train situations=5 num_seeds=2
	test -f dist/elsewhere/outputs/*/summary.json

torture: install  ## kill jobs at random moments, start them again, compare their files (KILLS=25); then jobs in bad surroundings (ROUNDS=200)
	$(BIN)/python benchmarks/torture.py --kills $(KILLS)
	$(BIN)/python benchmarks/surroundings.py --rounds $(ROUNDS)

soak: install  ## memory over many learning steps (STEPS=10 million)
	$(BIN)/python benchmarks/soak.py --steps $(STEPS)

bench: install  ## measure the figures of the README and docs/performance.md (SPEED=--large: 100,000 runs too)
	-@$(MAKE) --no-print-directory bench-jax
	$(BIN)/python benchmarks/command.py
	$(BIN)/python benchmarks/speed.py --write docs/performance.md $(SPEED)
	@$(MAKE) --no-print-directory bench-worlds

bench-worlds: install  ## the part of bench on worlds, beside VMAS and IR-SIM if they install (WORLDS=--quick: a check)
	-@$(MAKE) --no-print-directory $(VMAS)/installed $(IRSIM)/installed
	$(BIN)/python benchmarks/worlds.py --write docs/performance.md $(WORLDS)

bench-loggers: install  ## time the logging of 1,000 runs, for docs/loggers.md
	$(BIN)/python benchmarks/loggers.py

agreement: install  ## compare 2,000 runs that learn eagerly and compiled; takes minutes
	$(BIN)/python benchmarks/agreement.py

random-driving: install  ## a million random steps in 1,000 random worlds: no overlap, no NaN, no impossible reading
	$(BIN)/python benchmarks/random_driving.py

bench-jax: $(JAX)/installed  ## install JAX in its own environment for bench, which skips JAX if that fails

peers: install $(SB3)/installed  ## docs/peers.md: TorchRL's and Stable-Baselines3's DQN on the same task (takes twelve minutes)
	$(BIN)/python -m benchmarks.peers

check-sb3: install $(SB3)/installed  ## Stable-Baselines3's checker on the tasks that are registered with Gymnasium
	$(SB3)/bin/python -m benchmarks.peers.checker

lint: install  ## ruff and mypy
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: install  ## rewrite the code as ruff would have it
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean:  ## remove .venv and the environments of benchmarks, foreign readers and the browser, dist and caches, never outputs/
	rm -rf $(VENV) docs/_site $(JAX) $(VMAS) $(IRSIM) $(STREAM) $(SB3) $(FOREIGN) $(BROWSER) dist .hypothesis .mypy_cache .pytest_cache .ruff_cache

# The pins hold for build backends too; from pip 25.3 on these have their own variable.
$(STAMP) $(VENV)/docs $(SB3)/installed: export PIP_CONSTRAINT := constraints.txt
$(STAMP) $(VENV)/docs $(SB3)/installed: export PIP_BUILD_CONSTRAINT := constraints.txt
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed and $(PYTHON) is %d.%d: make PYTHON=/path/to/python3.11" % sys.version_info[:2])'
	@echo "Installing into $(VENV): some minutes the first time, torch is large"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install -qq -e '.[dev]'
	@touch $@

$(VENV)/docs: docs/requirements.txt $(STAMP)
	@$(BIN)/python -m pip install -qq -r $<
	@touch $@

$(JAX)/installed $(VMAS)/installed $(IRSIM)/installed: benchmarks/.%/installed: benchmarks/%-requirements.txt
	@$(PYTHON) -m venv $(@D)
	@$(@D)/bin/python -m pip install -qq -r $<
	@touch $@

$(FOREIGN)/installed: tests/foreign/requirements.txt
	@$(PYTHON) -m venv $(FOREIGN)
	@$(FOREIGN)/bin/python -m pip install -qq -r $<
	@touch $@

$(BROWSER)/installed: tests/browser/requirements.txt
	@$(PYTHON) -m venv $(BROWSER)
	@$(BROWSER)/bin/python -m pip install -qq -r $<
	@touch $@

$(SB3)/installed: benchmarks/peers/requirements.txt pyproject.toml constraints.txt
	@$(PYTHON) -m venv $(SB3)
	@$(SB3)/bin/python -m pip install -qq -r $< -e '.[gymnasium]'
	@touch $@
