"""A Dask cluster of real processes, for tests."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from evolve.search.dask_executor import DaskExecutor
from evolve.search.job import ExecutorError
from evolve.search.scheduler import Scheduler

ROOT = Path(__file__).parents[3]


class Cluster:
    """Processes of a scheduler and its workers; `tls` is a certificate and its key, required for all connections."""

    def __init__(self, folder, tls=()):
        self.folder, self.protocol = folder, "tls" if tls else "tcp"
        self.files = (tls[0], *tls) if tls else ()
        self.flags = [
            x for pair in zip(("--tls-ca-file", "--tls-cert", "--tls-key"), self.files, strict=False) for x in pair
        ]
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"{self.protocol}://127.0.0.1:{free.getsockname()[1]}"
        self.processes = {"scheduler": [], "worker": []}
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT), "RHABDOM_TEST": str(folder)}

    def start(self, workers=2):
        port = self.address.rpartition(":")[2]
        own = ("--protocol", self.protocol, "--host", "127.0.0.1", "--port", port, "--dashboard-address", ":0")
        if not self.processes["scheduler"]:
            self._run("scheduler", *own)
        for _ in range(workers):
            self._run("worker", self.address, "--nthreads", "1", "--dashboard-address", ":0", "--death-timeout", "60")

    def _run(self, *arguments):
        command = [sys.executable, "-m", "dask", *arguments, *self.flags]
        log = (self.folder / f"{arguments[0]}.log").open("a")
        self.processes[arguments[0]].append(
            subprocess.Popen(
                command, cwd=self.folder, env=self.environment, stdout=log, stderr=log, start_new_session=True
            )
        )
        log.close()

    def signal(self, kind, number, count=None):
        """Send a signal to all processes of a kind, "scheduler" or "worker", or to the first `count` of them.

        Nannies receive it together with their workers.
        """
        for process in self.processes[kind][:count]:
            os.killpg(process.pid, number)

    def kill(self, *kinds):
        """Kill all processes of these kinds at once, or of both kinds, including nannies and their workers."""
        for kind in kinds or tuple(self.processes):
            self.signal(kind, signal.SIGKILL)
            for process in self.processes[kind]:
                process.wait()
            self.processes[kind] = []

    def heal(self, workers=2):
        """Continue stopped processes, replace dead ones, and wait until all workers are connected.

        A worker that was stopped may be given up by the scheduler and not connect again, although its process runs. If
        a worker is missing after half a minute, all are replaced.
        """
        for kind, processes in self.processes.items():
            self.processes[kind] = [process for process in processes if process.poll() is None]
            self.signal(kind, signal.SIGCONT)
        if not self.processes["scheduler"]:
            self.kill("worker")  # workers may end if their scheduler does
        self.start(workers - len(self.processes["worker"]))
        deadline = time.monotonic() + 120
        while True:
            try:
                client = Scheduler(self.address, *self.files).client(60)
                break
            except ExecutorError:
                assert time.monotonic() < deadline, "the scheduler does not answer"
        try:
            client.wait_for_workers(workers, timeout=30)
        except TimeoutError:
            self.kill("worker")
            self.start(workers)
            client.wait_for_workers(workers, timeout=120)
        client.close()

    def executor(self, function, patience_s=60.0, **options):
        scheduler = Scheduler(self.address, *self.files)
        return DaskExecutor(scheduler, f"tests.evolve.remote_form:{function}", patience_s=patience_s, **options)

    def calls(self):
        """Return the number of starts of each candidate since the last call."""
        log = self.folder / "calls.log"
        names = [int(line.split()[0]) for line in log.read_text().splitlines()] if log.exists() else []
        log.unlink(missing_ok=True)
        return {name: names.count(name) for name in names}
