"""Address of a Dask scheduler, and certificates for its connections."""

from __future__ import annotations

import contextlib
import logging
import re
import socket
import ssl
import threading
import time
from asyncio import CancelledError
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from evolve.config.checks import ConfigError
from evolve.search.job import ExecutorError

__all__ = ["Scheduler", "close"]

ADDRESS = re.compile(r"(?:(?P<protocol>tcp|tls)://)?(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[^\s:/\[\]]+):(?P<port>\d{1,5})")
ANSWER_S = 5.0  # [s] time limit for an answer, enough for a scheduler that is just starting
RETRY_S = 0.25  # [s] interval between attempts to connect
CLOSE_S = 2.0  # [s] time limit for closing a connection, which a silent scheduler does not confirm


@dataclass(frozen=True)
class Scheduler:
    """A Dask scheduler: its address, and the certificates for encrypted connections to it.

    address: "tls://host:8786", or "tcp://host:8786" or "host:8786" in a trusted network
    ca_file: certificates of the authorities that signed the certificates of scheduler and workers
    certificate, key: certificate and private key of this process

    The last three are paths of PEM files. If they are None, Dask's own settings (distributed.comm.tls) apply.

    Raises:
        ConfigError: the address is malformed, certificates are missing or invalid, or certificates are given for an
            address without encryption.
    """

    address: str
    ca_file: Path | None = None
    certificate: Path | None = None
    key: Path | None = None

    def __post_init__(self) -> None:
        found = ADDRESS.fullmatch(self.address)
        if found is None or not 0 < int(found["port"]) < 65536:
            raise ConfigError(f"--scheduler {self.address}: must be an address with a port, such as tls://host:8786")
        given = [file for file in (self.ca_file, self.certificate, self.key) if file is not None]
        if len(given) not in (0, 3):
            raise ConfigError("--tls-ca-file, --tls-cert and --tls-key: must be given together, or not at all")
        if given and not self.encrypted:
            raise ConfigError(f"--scheduler {self.address}: must begin with tls:// if certificates are given")
        if given:
            self._require_certificates()

    @property
    def encrypted(self) -> bool:
        """True if connections to the scheduler are encrypted, so that its address begins with "tls://"."""
        return self.address.startswith("tls://")

    def _require_certificates(self) -> None:
        """Check the PEM files of this object (certificates and private key) before Dask uses them.

        Dask would report invalid files only later, in long messages.

        Raises:
            ConfigError: a file is missing or invalid.
        """
        for file in (self.ca_file, self.certificate, self.key):
            if not Path(str(file)).is_file():
                raise ConfigError(f"{file}: no such file: must be a PEM file")
        try:
            context = ssl.create_default_context(cafile=str(self.ca_file))
            context.load_cert_chain(str(self.certificate), str(self.key))
        except (ssl.SSLError, OSError) as error:
            reason = getattr(error, "reason", None) or error.strerror or error
            raise ConfigError(
                f"{self.ca_file}, {self.certificate}, {self.key}: must be PEM files of certificates, and of the key "
                f"that belongs to the second ({reason})"
            ) from None

    def require_answer(self) -> None:
        """Check, before a run starts, that the scheduler answers.

        If the address begins with tls://, the certificates of this object are used. If it has none, those in Dask's own
        settings are used.

        Raises:
            ConfigError: the address begins with tls://, but neither this object nor Dask's settings name certificates.
            ExecutorError: the scheduler does not answer within 5 s, or Dask is not installed.
        """
        self.security()
        found = ADDRESS.fullmatch(self.address)
        assert found is not None
        host, port = found["host"].strip("[]"), int(found["port"])
        deadline = time.monotonic() + ANSWER_S
        while True:
            try:
                socket.create_connection((host, port), timeout=max(RETRY_S, deadline - time.monotonic())).close()
                break
            except (OSError, UnicodeError) as error:
                unknown = isinstance(error, socket.gaierror | UnicodeError)
                if unknown or time.monotonic() + RETRY_S > deadline:
                    reason = "there is no such host" if unknown else error
                    raise ExecutorError(f"no Dask scheduler answers at {self.address}: {reason}") from None
            time.sleep(RETRY_S)
        close(self.client(ANSWER_S))

    def client(self, timeout: float) -> Any:
        """Return a Dask client that is connected to the scheduler.

        timeout: maximum time for the connection [s]

        Raises:
            ConfigError: the address begins with tls://, but neither this object nor Dask's settings name certificates.
            ExecutorError: the scheduler does not answer in time, or Dask is not installed.
        """
        security = self.security()
        from distributed import Client

        _silence_dask()
        opened: SimpleQueue[Any] = SimpleQueue()

        def connect() -> None:
            try:
                opened.put(Client(self.address, timeout=timeout, security=security, set_as_default=False))
            except Exception as error:
                opened.put(error)

        # Dask's own time limit excludes the first messages, for which a stopped scheduler would let it wait forever.
        threading.Thread(target=connect, daemon=True).start()
        try:
            client = opened.get(timeout=timeout + RETRY_S)
        except Empty:
            client = TimeoutError(f"no answer within {timeout:g} s")
        if not isinstance(client, Exception):
            return client
        if not isinstance(client, OSError | ValueError):
            raise client
        raise ExecutorError(f"no Dask scheduler answers at {self.address}: {self._reason(client)}") from None

    def _reason(self, error: Exception) -> str:
        """Return the reason for a failed connection in one line, with the remedy if encryption is the cause."""
        from distributed.comm.core import CommClosedError

        # Tornado raises a ValueError if the answer to the handshake is not TLS and arrives early.
        if not isinstance(error, CommClosedError) and not (self.encrypted and isinstance(error, ValueError)):
            return (str(error) or type(error).__name__).splitlines()[0]
        if self.encrypted:
            return "the TLS handshake failed; the scheduler must use TLS, and its certificates must match these files"
        return "it closed the connection; if it uses TLS, the address must begin with tls://"

    def security(self) -> Any:
        """Return Dask's `Security` with the certificates of this object; None if Dask's own settings apply.

        Raises:
            ConfigError: the address begins with tls://, but neither this object nor Dask's settings name certificates.
            ExecutorError: Dask is not installed.
        """
        try:
            import dask
            from distributed.security import Security
        except ImportError:
            raise ExecutorError("--executor dask needs Dask: pip install 'rhabdom[dask]'") from None

        if self.ca_file is not None:
            client = {"tls_client_cert": str(self.certificate), "tls_client_key": str(self.key)}
            return Security(tls_ca_file=str(self.ca_file), require_encryption=True, **client)
        if self.encrypted and not dask.config.get("distributed.comm.tls.ca-file", None):
            raise ConfigError(
                f"--scheduler {self.address}: needs certificates: --tls-ca-file, --tls-cert and --tls-key"
            )
        return None


def close(client: Any) -> None:
    """Close a Dask client. Errors are ignored, because closing fails if the connection is already lost."""
    with contextlib.suppress(Exception, CancelledError):
        client.close(timeout=CLOSE_S)


def _silence_dask() -> None:
    """Suppress log messages of Dask in this process.

    They would show long tracebacks of lost connections, which rhabdom itself reports in one line.
    """
    for name in ("distributed", "tornado", "asyncio", *logging.root.manager.loggerDict):
        if name.split(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
