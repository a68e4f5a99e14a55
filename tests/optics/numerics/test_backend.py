"""The LLVM check distinguishes good, missing, refused and aborting libraries and survives all of them."""

import os
import subprocess
import sys
from importlib import metadata

import pytest

from optics.numerics import backend


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def run_child(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_good_library_is_found_and_named():
    chosen, tried = backend.find(cached=False)
    assert chosen is not None, tried
    assert int(chosen.version.split(".")[0]) >= 17


def test_newest_library_comes_first():
    names = ["/x/libLLVM-15.so.1", "/x/libLLVM.so.19.1", "/x/libLLVM-14.0.6.so.1", "/x/libLLVM.so.22.1"]
    assert sorted(names, key=backend._version_in_name, reverse=True) == [
        names[3],
        names[1],
        names[0],
        names[2],
    ]


def test_missing_library():
    assert backend.prove("/nowhere/libLLVM.so").verdict == "missing"


def test_library_that_is_not_llvm(tmp_path):
    impostor = tmp_path / "libLLVM.so"
    impostor.write_bytes(b"not a library")
    assert backend.prove(str(impostor)).verdict == "too old"


def test_abort_of_the_child_is_survived(monkeypatch):
    """LLVM 15 and 16 end the process by SIGABRT; the test simulates this on every machine."""
    monkeypatch.setattr(backend, "PROBE", "import os; os.abort()")
    assert backend.prove("libLLVM.so").verdict == "aborts"


@pytest.mark.parametrize("path", [p for p in ("/usr/lib/x86_64-linux-gnu/libLLVM-15.so.1",) if os.path.exists(p)])
def test_real_aborting_library(path):
    assert backend.prove(path).verdict == "aborts"


def test_verdict_is_cached_and_proved_anew_for_another_file(tmp_path, monkeypatch):
    library = tmp_path / "libLLVM.so"
    library.write_bytes(b"one")
    calls = []

    def counted(path: str) -> backend.Llvm:
        calls.append(path)
        return backend.Llvm(path, "good", "19.0")

    monkeypatch.setattr(backend, "prove", counted)
    for _ in range(2):
        assert backend.find([str(library)])[0] == backend.Llvm(str(library), "good", "19.0")
    assert len(calls) == 1
    library.write_bytes(b"another")
    backend.find([str(library)])
    assert len(calls) == 2


def test_the_version_of_drjit_is_that_of_its_metadata():
    assert backend._drjit_version() == metadata.version("drjit")


def test_corrupt_cache_is_ignored(tmp_path, monkeypatch):
    cache = tmp_path / "rhabdom" / "llvm.json"
    cache.parent.mkdir()
    monkeypatch.setattr(backend, "prove", lambda path: backend.Llvm(path, "good", "19.0"))
    for content in ("{", "[1]", '{"x": 1}'):
        cache.write_text(content)
        assert backend.find(["/x/libLLVM.so"])[0] is not None


def test_user_error_is_one_line_with_the_remedy(tmp_path):
    child = run_child(
        "from optics.numerics import backend\ntry: backend.require()\nexcept backend.BackendError as e: print(e)",
        DRJIT_LIBLLVM_PATH=str(tmp_path / "none.so"),
    )
    assert child.returncode == 0, child.stderr
    assert len(child.stdout.strip().splitlines()) == 1
    assert "no such file" in child.stdout
    assert "apt-get install libllvm19" in child.stdout


def test_require_points_drjit_at_the_library():
    child = run_child(
        "import drjit as dr; from optics.numerics import backend; found = backend.require()\n"
        "from drjit.llvm import Float; import os\n"
        "assert os.environ['DRJIT_LIBLLVM_PATH'] == found.path\n"
        "assert '.'.join(map(str, dr.detail.llvm_version())) == found.version\n"
        "print(dr.maximum(Float(1), 2))"
    )
    assert child.returncode == 0, child.stderr


@pytest.mark.parametrize("verdict", ["broken", "too old", "missing"])
def test_what_may_be_mended_under_the_same_path_is_proved_again(verdict, tmp_path, monkeypatch):
    """A repair, such as installing libatomic, may make the same library file usable, so it must be tested again."""
    library = tmp_path / "libLLVM.so"
    library.write_bytes(b"one")
    verdicts = iter([verdict, "good"])
    monkeypatch.setattr(backend, "prove", lambda path: backend.Llvm(path, next(verdicts)))
    assert backend.find([str(library)])[0] is None
    assert backend.find([str(library)])[0].good


def test_an_abort_is_not_tried_twice(monkeypatch):
    verdicts = iter(["aborts"])
    monkeypatch.setattr(backend, "prove", lambda path: backend.Llvm(path, next(verdicts)))
    for _ in range(2):
        assert backend.find(["/x/libLLVM.so"])[1][0].verdict == "aborts"
