"""Addresses without a scheduler, schedulers that do not answer, and invalid certificates give one line at once."""

import shutil
import socket
import subprocess

import pytest

from evolve.cli.main import main
from evolve.config.checks import ConfigError
from evolve.search.job import ExecutorError
from evolve.search.scheduler import Scheduler

pytest.importorskip("distributed")


def certificates(folder, name="own"):
    """Return a self-signed certificate and its key, created by the commands in docs/cluster.md."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    cert, key = folder / f"{name}-cert.pem", folder / f"{name}-key.pem"
    request = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc"]
    made = [*request, "-days", "30", "-subj", "/CN=rhabdom", "-keyout", key, "-out", cert]
    subprocess.run(made, check=True, capture_output=True)
    return cert, key


def without_workers(protocol, security=None):
    """Return a cluster of a scheduler in this process without workers."""
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=0, processes=False, dashboard_address=":0", protocol=protocol, security=security, silence_logs=50
    )


@pytest.mark.parametrize(
    "address", ["foo", "", "tcp://", "tcp://host", "host:0", "host:99999", "http://host:1", "a b:1"]
)
def test_what_is_no_address_is_refused_at_once(address):
    with pytest.raises(ConfigError, match=r"must be an address with a port, such as tls://host:8786"):
        Scheduler(address)


@pytest.mark.parametrize("address", ["host:1", "tcp://10.0.0.1:8786", "tls://node-3.cluster:8786", "tcp://[::1]:8786"])
def test_addresses_are_taken_as_dask_writes_them(address):
    assert Scheduler(address).encrypted == address.startswith("tls")


def test_a_scheduler_that_is_not_there_is_no_run(tmp_path, capsys, monkeypatch):
    """Dask is not called, because it would retry for a minute."""
    monkeypatch.setattr("distributed.Client", None)
    monkeypatch.setattr("evolve.search.scheduler.ANSWER_S", 1.0)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    for name in (address, "foo", "tcp://nowhere.invalid:8786"):
        command = ["run", "detection", "--out", str(tmp_path / "run"), "--executor", "dask", "--scheduler", name]
        assert main(command) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "run").exists()


@pytest.fixture(scope="module")
def encrypted(tmp_path_factory):
    """Return the address of a scheduler that requires certificates, and its certificate and key."""
    from distributed.security import Security

    cert, key = certificates(tmp_path_factory.mktemp("tls"))
    roles = ("scheduler", "client")
    own = {f"tls_{role}_{kind}": str(file) for role in roles for kind, file in (("cert", cert), ("key", key))}
    with without_workers("tls", Security(tls_ca_file=str(cert), require_encryption=True, **own)) as cluster:
        yield cluster.scheduler_address, cert, key


@pytest.fixture(scope="module")
def unencrypted():
    with without_workers("tcp") as cluster:
        yield cluster.scheduler_address


@pytest.mark.parametrize("wrong", ["foreign certificates", "foreign authority", "foreign key", "tcp", "tls", "mute"])
def test_a_scheduler_that_refuses_the_connection_is_no_run(tmp_path, encrypted, unencrypted, wrong, capfd, monkeypatch):
    """The run directory is created only after the scheduler has answered through the connection that the run uses."""
    monkeypatch.setattr("evolve.search.scheduler.ANSWER_S", 1.0)
    address, *own = encrypted
    other = certificates(tmp_path, "other")
    with socket.create_server(("127.0.0.1", 0)) as server:
        plain = f"127.0.0.1:{server.getsockname()[1]}"
        address, ca, cert, key = {
            "foreign certificates": (address, other[0], *other),
            "foreign authority": (address, other[0], *own),
            "foreign key": (address, own[0], *other),
            "tcp": (address.replace("tls", "tcp"), None, None, None),
            "tls": (unencrypted.replace("tcp", "tls"), own[0], *own),
            "mute": (f"tcp://{plain}", None, None, None),
        }[wrong]
        flags = [] if ca is None else ["--tls-ca-file", str(ca), "--tls-cert", str(cert), "--tls-key", str(key)]
        command = ["run", "detection", "--preset", "quick", "--out", str(tmp_path / "run"), "--executor", "dask"]
        assert main([*command, "--scheduler", address, *flags]) == 2
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert f"no Dask scheduler answers at {address}: " in said
    remedy = {"tcp": "the address must begin with tls://", "mute": "no answer within 1 s"}
    assert remedy.get(wrong, "the TLS handshake failed") in said
    assert not (tmp_path / "run").exists()


def test_a_scheduler_that_accepts_the_certificates_answers(encrypted):
    address, cert, key = encrypted
    Scheduler(address, cert, cert, key).require_answer()


def test_certificates_are_all_there_and_fit_together(tmp_path):
    cert, key = certificates(tmp_path)
    _, other = certificates(tmp_path, "other")
    address = "tls://127.0.0.1:8786"
    assert Scheduler(address, cert, cert, key).security().require_encryption
    with pytest.raises(ConfigError, match="must be given together"):
        Scheduler(address, cert, cert)
    with pytest.raises(ConfigError, match="must begin with tls://"):
        Scheduler("tcp://127.0.0.1:8786", cert, cert, key)
    with pytest.raises(ConfigError, match=r"none\.pem: no such file"):
        Scheduler(address, cert, tmp_path / "none.pem", key)
    with pytest.raises(ConfigError, match="the key that belongs to the second"):
        Scheduler(address, cert, cert, other)
    with pytest.raises(ConfigError, match="must be PEM files"):
        Scheduler(address, key, cert, key)
    with pytest.raises(ConfigError, match="needs certificates: --tls-ca-file"):
        Scheduler(address).require_answer()


def test_flags_reach_dask(tmp_path, monkeypatch, capsys):
    cert, key = certificates(tmp_path)
    seen = []

    def executor(scheduler, note):
        seen.append(scheduler)
        raise ExecutorError("that will do")

    monkeypatch.setattr("evolve.cli.commands.run.DaskExecutor", executor)
    monkeypatch.setattr(Scheduler, "require_answer", lambda scheduler: None)
    files = ["--tls-ca-file", str(cert), "--tls-cert", str(cert), "--tls-key", str(key)]
    address = "tls://127.0.0.1:8786"
    begin = ["run", "detection", "--preset", "quick", "--out", str(tmp_path / "run"), "--executor", "dask"]
    assert main([*begin, "--scheduler", address, *files]) == 2
    assert main(["resume", str(tmp_path / "run"), "--executor", "dask", "--scheduler", address, *files]) == 2
    assert seen == [Scheduler(address, cert, cert, key)] * 2
    assert capsys.readouterr().err.count("that will do") == 2
    assert main([*begin[:-2], *files]) == 2
    assert "no other executor takes one" in capsys.readouterr().err
