// The program under test: started on a scratch folder, with its own home, so that nothing of the user's is read or written.
import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync } from "node:fs";
import { basename, join, resolve } from "node:path";

const START_TIMEOUT = 20_000;

export class Server {
  /** Everything that the program printed. */
  said = "";
  url = "";
  #process = null;

  constructor(root, scratch) {
    this.root = root;
    this.folder = join(scratch, "project");
    this.home = join(scratch, "home");
    this.program = process.env.PLUMBLINE_BIN ?? resolve(root, process.env.CARGO_TARGET_DIR ?? "target", "debug/plumbline");
  }

  /** Copies files of media/ (or files by absolute path) into the folder. */
  prepare(media) {
    assert.ok(existsSync(this.program), `the program is missing: ${this.program} (cargo build)`);
    mkdirSync(this.folder, { recursive: true });
    mkdirSync(this.home, { recursive: true });
    for (const name of media) this.add(name);
  }

  add(name) {
    copyFileSync(name.startsWith("/") ? name : join(this.root, "media", name), join(this.folder, basename(name)));
  }

  #environment() {
    const { HOME, XDG_STATE_HOME, XDG_DATA_HOME, XDG_CACHE_HOME, XDG_CONFIG_HOME, XDG_RUNTIME_DIR, ...rest } = process.env;
    return { ...rest, HOME: this.home, RUST_BACKTRACE: "1" };
  }

  /** Starts it; `url` is the link that it prints. */
  async start(open, args = []) {
    const port = this.port ? ["--port", String(this.port)] : [];
    const target = open ? join(this.folder, open) : this.folder;
    this.#last = { open, args };
    this.#process = spawn(this.program, ["studio", target, "--no-open", ...port, ...args], { cwd: this.folder, env: this.#environment() });
    const said = this.said.length;
    for (const stream of [this.#process.stdout, this.#process.stderr]) stream.on("data", (data) => (this.said += data));
    const end = Date.now() + START_TIMEOUT;
    for (;;) {
      const found = this.said.slice(said).match(/http:\/\/127\.0\.0\.1:(\d+)\/\S*#\S+/);
      if (found) {
        this.url = found[0];
        this.port = Number(found[1]);
        return;
      }
      if (this.#process.exitCode !== null || Date.now() > end) assert.fail(`the studio did not start:\n${this.said}`);
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
  }
  #last = {};

  get pid() {
    return this.#process.pid;
  }

  /** Ends it at once, as a crash does. */
  async kill() {
    const child = this.#process;
    if (!child || child.exitCode !== null || child.signalCode !== null) return;
    const ended = new Promise((resolve) => child.once("exit", resolve));
    child.kill("SIGKILL");
    await ended;
  }

  /** Starts it again on the same port, as a user does after a crash. */
  restart() {
    return this.start(this.#last.open, this.#last.args);
  }

  /** Runs `plumbline …` in the folder, gives what it printed. */
  run(...args) {
    return new Promise((resolve, reject) =>
      execFile(this.program, args, { cwd: this.folder, env: this.#environment(), maxBuffer: 1 << 26 }, (error, stdout, stderr) =>
        error ? reject(new Error(`plumbline ${args.join(" ")}: ${stderr}`)) : resolve(stdout)));
  }
}
