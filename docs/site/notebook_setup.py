# Installs rhabdom and LLVM if they are missing. SOURCE is the address of a repository, or the path of a wheel.
import importlib.util
import shutil
import subprocess
import sys

SOURCE = "git+https://github.com/rhabdom/rhabdom"

if importlib.util.find_spec("rhabdom") is None:
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", SOURCE], check=True)
    importlib.invalidate_caches()

from rhabdom.optics.numerics import backend

if backend.find()[0] is None and shutil.which("apt-get"):  # needs root, as on hosted notebooks
    subprocess.run(["apt-get", "update", "-qq"], check=True)
    subprocess.run(["apt-get", "install", "-y", "-qq", "libllvm19", "libatomic1"], check=True)
backend.require()
