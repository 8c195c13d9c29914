# The few commands of this project; `make help` lists them. Cargo does the work.

export PATH := $(PATH):$(HOME)/.cargo/bin
# Nothing that is tested or measured comes from the cache of the user.
export PLUMBLINE_CACHE :=
.DEFAULT_GOAL := help
.PHONY: help demo studio studio-page studio-test test test-long deny memcheck miri soak bench media gallery deps deps-build lint unit oracle engine engine-long page-if-possible

CLIP ?= media/street-walk.mp4

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1\t\2/p' $(MAKEFILE_LIST) | awk -F'\t' '{ printf "  make %-12s %s\n", $$1, $$2 }'

demo: deps-build page-if-possible ## installs what is missing, builds, stabilizes a clip of media/ and says where the result lies
	cargo build --release --locked
	@mkdir -p out
	target/release/plumbline stabilize $(CLIP) -o out/steady.mp4 --compare --overwrite

# The page of the studio, embedded in the program. Cargo builds without it, and the program then names `make studio`.
UI := src/studio/ui
STUDIO ?= media/giraffe.ply

studio: deps-build ## installs what is missing, builds page and program, opens the studio on an example of media/
	@.ci/deps studio
	@$(MAKE) --no-print-directory studio-page
	cargo build --release --locked
	@mkdir -p out
	@test -e out/$(notdir $(STUDIO)) || cp $(STUDIO) out/
	target/release/plumbline studio out/$(notdir $(STUDIO)) --allow-path media

studio-page: $(UI)/dist/index.html ## builds the page of the studio where its sources changed (npm)

# The program is the one that the tests run: `cargo build` would build it again, with fewer features of its dependencies.
studio-test: deps studio-page ## tests of the studio in a real browser: any installed Chromium
	npm run --prefix $(UI) --silent check
	cargo test --workspace --locked --no-run
	npm run --prefix $(UI) --silent test

page-if-possible:
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory studio-page || \
		echo "the page of the studio could not be built; the program is built without it"; fi

# A program that was compiled without a page does not look for one by itself.
$(UI)/dist/index.html: $(UI)/node_modules/.package-lock.json $(UI)/build.mjs $(UI)/index.html $(UI)/icon.svg $(shell find $(UI)/src -type f)
	@test -e $@ || touch src/studio/server/assets.rs
	npm run --prefix $(UI) --silent build

$(UI)/node_modules/.package-lock.json: $(UI)/package-lock.json
	npm ci --prefix $(UI) --no-audit --no-fund
	@touch $@

test: deps page-if-possible lint unit studio-test oracle engine ## formatting, lints, all tests, documentation, oracles: what CI runs
	@echo "make test: all passed"

# Members without FFmpeg and clap; each is built alone, so that none leans on a feature that another turns on.
PURE := num image camera photo video shape testkit

test-long: test deny memcheck miri soak engine-long ## what takes longer: random cases by the thousand, kills, faults, soaks, valgrind, Miri, licenses, each library alone
	PROPTEST_CASES=1024 cargo test --workspace --locked
	PLUMBLINE_CASES=300 cargo test --workspace --locked --test it kills
	PLUMBLINE_CLIPS=60 cargo test --workspace --locked --test it killed_batch
	PLUMBLINE_CASES=200 cargo test --workspace --locked --test it faults
	PLUMBLINE_FUZZ_TIMES=30 cargo test --workspace --locked --test it fuzz
	for crate in $(PURE); do cargo check --locked --all-targets --package plumbline-$$crate || exit 1; done
	cargo check --locked --package plumbline --no-default-features
	cargo check --locked --package plumbline --no-default-features --features media

# The packages of all systems; `tests/it/dependencies.rs` checks those of this one.
deny:
	cargo deny --version >/dev/null 2>&1 || cargo install --locked cargo-deny
	cargo deny check licenses bans sources

# The binding of FFmpeg under valgrind: no invalid read or write, no use of what was never set.
memcheck: deps
	@.ci/deps long
	CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="valgrind --quiet --error-exitcode=9" \
		cargo test --workspace --locked --lib av::

# Loads and stores by pointer under Miri, with the instruction sets that it knows; other tests of unsafe code take it hours.
miri:
	rustup component add miri rust-src --toolchain nightly
	for tests in "video track::window::" "shape skinning::packed::tests::motions" "num sparse::wide_registers"; do \
		set -- $$tests; \
		MIRIFLAGS=-Zmiri-disable-isolation RUSTFLAGS="-Ctarget-feature=+avx2,+fma" \
			cargo +nightly miri test --target-dir target/miri --locked --package plumbline-$$1 --lib $$2 || exit 1; \
	done

soak: deps
	cargo build --release --locked
	python3 tests/soak/run.py target/release/plumbline
	python3 tests/soak/hostile.py target/release/plumbline

lint: deps
	cargo fmt --all --check
	cargo clippy --workspace --locked --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --locked --no-deps

unit: deps
	cargo test --workspace --locked

oracle: deps .venv/ready .venv/node_modules/ready
	NODE_PATH=$(CURDIR)/.venv/node_modules .venv/bin/python tests/oracle/run.py

# Plans on a Dask cluster of this machine, whose workers and scheduler are killed.
engine: deps .venv/ready
	cargo test --workspace --locked --no-run
	.venv/bin/python tests/engines/dask.py target/debug/plumbline

# The same with a clip of twelve seconds in parts.
engine-long: engine
	.venv/bin/python tests/engines/dask.py target/debug/plumbline --long

bench: deps-build ## Criterion benches (see benches/peers/ for the scripts that compare with others)
	cargo bench --workspace --locked

media: deps-build ## renders the clips, photos and meshes of media/ again
	cargo run --release --locked --example make_meshes media
	cargo run --release --locked --example render_clip -- --preset street-walk --out media
	cargo run --release --locked --example render_clip -- --preset rolling-passer --size 640x360 --frames 300 --out media
	for room in kb-125 equisolid-180 eucm rectilinear-100; do \
		cargo run --release --locked --example render_photo -- --preset room-$$room --out media || exit 1; done
	for street in fisheye people stitched; do \
		cargo run --release --locked --example render_street -- --preset street-$$street --out media || exit 1; done

gallery: deps ## draws the pictures of README.md again, from media/
	cargo build --release --locked
	docs/gallery.sh target/release/plumbline

deps: ## installs what building and testing need and is missing (apt; asks sudo where you are not root)
	@.ci/deps build test

deps-build:
	@.ci/deps build

# Made anew where the pinned versions change.
.venv/ready: tests/oracle/requirements.txt
	rm -rf .venv
	python3 -m venv .venv
	.venv/bin/pip install --quiet --disable-pip-version-check --require-virtualenv -r $<
	@touch $@

# The Khronos validator and an encoder of compressed files, for the oracle tests of glTF.
NPM_ORACLES := gltf-validator@2.0.0-dev.3.10 meshoptimizer@1.3.0
.venv/node_modules/ready: .venv/ready Makefile
	npm install --prefix .venv --no-save --no-package-lock --no-audit --no-fund $(NPM_ORACLES)
	@touch $@
