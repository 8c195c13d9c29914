"""Runs the tasks of a plan on a Dask cluster.

    python -m plumbline_dask PLAN.json --scheduler tls://head:8786 --tls-ca CA --tls-cert CERT --tls-key KEY

The plan is the truth: Dask is asked to call `plumbline task run` once per task, and what comes back is an exit status. Tasks
are idempotent, so that whatever is in doubt, after a worker died, was stopped or came back, or after the scheduler was
restarted, is run again: a task that is done already ends at once. This process touches no data.
"""
import argparse
import ipaddress
import json
import statistics
import sys
import time
from urllib.parse import urlsplit

EXIT_DONE, EXIT_USAGE, EXIT_PARTIAL, EXIT_PLAN, EXIT_TEMPORARY = 0, 2, 3, 4, 75
# Finished, also where a clip is cut short.
FINISHED = {0, 3}
# Another copy of the task is writing its result, or a reason that may be gone: memory, a share that is not mounted.
TRY_AGAIN = {73, 75, 129, 130, 143}
# A task that takes so many times the median, and at least so many seconds, gets a second copy.
STRAGGLER, STRAGGLER_SECONDS = 3.0, 10.0
# Seconds without a scheduler after which the run ends.
PATIENCE = 120.0
# Seconds for a worker to hand over an exit status.
ANSWER = 3.0
# Times that a task is given out again after its worker was lost, beside its retries: a worker that dies of it dies each time.
LOST = 5


def run_task(command, timeout):
    """Runs on a worker: the exit status, the end of what was printed, the host and the seconds. Standard library only, since it
    is sent there by value."""
    import ctypes
    import os
    import signal
    import socket
    import subprocess
    import tempfile
    import time

    def die_with_the_worker():
        os.setsid()
        try:
            ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG; Linux alone has it
        except (OSError, AttributeError):
            pass

    start = time.monotonic()
    with tempfile.TemporaryFile() as log:
        try:
            child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, preexec_fn=die_with_the_worker)
        except OSError as error:
            return 75, f"{command[0]}: {error}", socket.gethostname(), 0.0
        try:
            status = child.wait(timeout)
        except subprocess.TimeoutExpired:
            child.terminate()
            try:
                child.wait(5)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
            status = 75
        size = log.seek(0, os.SEEK_END)
        log.seek(max(0, size - 4000))
        text = log.read().decode(errors="replace")
    return status, text, socket.gethostname(), time.monotonic() - start


def is_loopback(address):
    host = urlsplit(address).hostname or ""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Failed(Exception):
    """A message and an exit status."""

    def __init__(self, status, message):
        super().__init__(message)
        self.status = status


class Run:
    """The tasks of a plan, and how far they are."""

    def __init__(self, args):
        self.args = args
        try:
            with open(args.plan, encoding="utf-8") as file:
                plan = json.load(file)
        except (OSError, ValueError) as error:
            raise Failed(EXIT_USAGE, f"{args.plan}: {error}") from error
        if plan.get("format") != "plumbline.plan":
            raise Failed(EXIT_USAGE, f"{args.plan}: not a plan of tasks")
        if plan.get("version") != 1:
            raise Failed(EXIT_PLAN, f"{args.plan}: a plan of another version")
        self.tasks = {task["id"]: task for task in plan["tasks"]}
        self.waiting = {name: set(task["after"]) for name, task in self.tasks.items()}
        self.copies = {}  # future key: (task, time when it was given out, future)
        self.tries = dict.fromkeys(self.tasks, 0)
        self.lost = dict.fromkeys(self.tasks, 0)
        self.second = set()
        self.status = {}  # task: exit status
        self.seconds = []
        self.start = time.monotonic()
        self.number = 0

    def event(self, name, **fields):
        if self.args.progress == "json":
            print(json.dumps({"ev": name, **fields, "t": round(time.monotonic() - self.start, 3)}), file=sys.stderr, flush=True)
        elif name == "task.fail":
            print(f"error: {fields['task']} (exit status {fields['code']}):\n{fields['error']}", file=sys.stderr, flush=True)

    def give_out(self, client, name, workers=None):
        task, args = self.tasks[name], self.args
        command = [args.program, "task", "run", "--plan", args.remote_plan or args.plan, "--root", args.root, "--task", name,
                   "--progress", "none", *(word for rule in args.path_map for word in ("--path-map", rule))]
        self.number += 1
        resources = {"cpus": task["resources"]["cpus"]} if args.resources else None
        future = client.submit(run_task, command, task["timeout_s"], key=f"{task['key']}-{self.number}", workers=workers,
                               resources=resources, retries=0, pure=False)
        self.copies[future.key] = (name, time.monotonic(), future)
        self.event("task.start", task=name)

    def running(self):
        return {name for name, _, _ in self.copies.values()}

    def give_out_ready(self, client):
        running = self.running()
        for name, after in self.waiting.items():
            if not after and name not in running and name not in self.status:
                self.give_out(client, name)

    def ended(self, name, result):
        """A copy of a task ended with `result`, or was lost."""
        if name in self.status:
            return
        if result is None:
            self.lost[name] += 1
            if self.lost[name] <= LOST:
                return  # given out again
            status, text, host, seconds = EXIT_TEMPORARY, "its workers died", "", 0.0
        else:
            status, text, host, seconds = result
        others = name in self.running()
        if status in FINISHED:
            self.status[name] = status
            self.seconds.append(seconds)
            for after in self.waiting.values():
                after.discard(name)
            self.event("task.done", task=name, host=host, seconds=round(seconds, 3), code=status)
        elif others and (status in TRY_AGAIN or status < 0):
            return  # the other copy decides
        elif (status in TRY_AGAIN or status < 0) and self.tries[name] < self.tasks[name]["retries"]:
            self.tries[name] += 1
            self.event("task.retry", task=name, attempt=self.tries[name] + 1, error=text[-400:])
        else:
            self.status[name] = status
            self.event("task.fail", task=name, code=status, error=text, host=host)
            for other, after in self.waiting.items():
                if name in after and other not in self.status:
                    self.ended(other, (status, f"waits for {name}, which failed", "", 0.0))

    def second_copies(self, client):
        """A second copy of what takes much longer than the rest, on another worker: safe, since results appear whole."""
        if len(self.seconds) < 3:
            return
        limit = max(STRAGGLER * statistics.median(self.seconds), STRAGGLER_SECONDS)
        now = time.monotonic()
        slow = [(key, name) for key, (name, since, _) in self.copies.items() if now - since > limit and name not in self.second]
        if not slow:
            return
        holders = {key: worker for worker, keys in client.processing().items() for key in keys}
        workers = list(client.scheduler_info(n_workers=-1)["workers"])
        for key, name in slow:
            others = [worker for worker in workers if worker != holders.get(key)]
            # What no worker holds waits for one, and is not slow.
            if key in holders and others:
                self.second.add(name)
                self.give_out(client, name, others)

    def work(self, client):
        """Until all is done, or the scheduler is lost: then False."""
        while len(self.status) < len(self.tasks):
            if client.status not in ("running", "connecting"):
                return False
            self.give_out_ready(client)
            over = [key for key, (_, _, future) in self.copies.items() if future.status != "pending"]
            for key in over:
                name, _, future = self.copies.pop(key)
                self.ended(name, result_of(future))
            if not over:
                self.second_copies(client)
                time.sleep(0.05)
        return True


def result_of(future):
    """What a task gave; None where that is lost: it is with a worker that died, or answers no longer."""
    if future.status != "finished":
        return None
    try:
        return future.result(timeout=ANSWER)
    except Exception:  # whatever the cluster is at fault for, the task is given out again
        return None


def connected(args):
    from distributed import Client
    from distributed.security import Security

    security = None
    if args.tls_ca:
        security = Security(tls_ca_file=args.tls_ca, tls_client_cert=args.tls_cert, tls_client_key=args.tls_key,
                            require_encryption=True)
    return Client(args.scheduler, security=security, timeout=10, set_as_default=False)


def run(args):
    if urlsplit(args.scheduler).scheme not in ("tls", "tcp"):
        raise Failed(EXIT_USAGE, f"{args.scheduler}: no address of a scheduler (expected tls://HOST:PORT)")
    if args.scheduler.startswith("tcp:") and not is_loopback(args.scheduler) and not args.insecure_scheduler:
        raise Failed(EXIT_USAGE, f"{args.scheduler}: anyone in the network could run programs there; use tls://, or permit it "
                                 "with --insecure-scheduler")
    work = Run(args)
    work.event("run.start", items=len(work.tasks))
    deadline = time.monotonic() + (PATIENCE if args.wait else 0)
    while True:
        try:
            client = connected(args)
        except (OSError, TimeoutError) as error:
            if time.monotonic() > deadline:
                raise Failed(EXIT_TEMPORARY, f"{args.scheduler}: no scheduler answers: {error}") from error
            time.sleep(1)
            continue
        try:
            done = work.work(client)
        finally:
            client.close(timeout=5)
        if done:
            break
        # What was given out is in doubt, and given out again.
        work.copies.clear()
        deadline = time.monotonic() + PATIENCE
    failed = sum(status not in FINISHED for status in work.status.values())
    partial = any(status != EXIT_DONE for status in work.status.values())
    work.event("run.end", done=len(work.tasks) - failed, failed=failed, seconds=round(time.monotonic() - work.start, 3))
    if args.progress != "json":
        print(f"{len(work.tasks) - failed} of {len(work.tasks)} tasks done", file=sys.stderr)
    return EXIT_PARTIAL if partial else EXIT_DONE


def main():
    parser = argparse.ArgumentParser(prog="plumbline_dask", description="Run the tasks of a plan on a Dask cluster.")
    parser.add_argument("plan", help="the plan, as `plumbline plan --json` wrote it")
    parser.add_argument("--scheduler", required=True, help="tls://HOST:PORT, or tcp:// on this machine")
    parser.add_argument("--root", required=True, help="the shared folder that the plan's paths start from, on the workers")
    parser.add_argument("--remote-plan", help="the plan's path on the workers, if it is another there")
    parser.add_argument("--path-map", action="append", default=[], metavar="FROM=TO",
                        help="a folder outside the root that the workers have elsewhere; may be repeated")
    parser.add_argument("--program", default="plumbline", help="the program on the workers")
    parser.add_argument("--tls-ca", help="certificates of authorities (PEM)")
    parser.add_argument("--tls-cert", help="own certificate (PEM)")
    parser.add_argument("--tls-key", help="its key (PEM)")
    parser.add_argument("--insecure-scheduler", action="store_true", help="permit tcp:// beyond this machine")
    parser.add_argument("--resources", action="store_true", help="workers were started with --resources cpus=N: ask for them")
    parser.add_argument("--wait", action="store_true", help="wait up to two minutes for the scheduler to start")
    parser.add_argument("--progress", choices=["auto", "json"], default="auto", help="json: one object per event on standard error")
    try:
        sys.exit(run(parser.parse_args()))
    except Failed as failed:
        print(f"error: {failed}", file=sys.stderr)
        sys.exit(failed.status)


if __name__ == "__main__":
    main()
