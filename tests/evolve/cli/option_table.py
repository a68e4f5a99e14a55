"""An example of each argument of each command, for `test_options`."""

from tests.evolve.closed_form import TINY

CHANGES = None  # the argument changes an output
QUICK = [part for setting in (*TINY, "search.generations=1") for part in ("--set", setting)]
DRY = ["run", "detection", *QUICK, "--dry-run"]
RUN = ["run", "detection", *QUICK, "--out", "new"]
RESUME = ["resume", "begun"]
PLAN = r"must be left out with --dry-run"
DASK = ["--executor", "dask", "--scheduler", "tcp://host:1"]
TLS = [part for name in ("ca-file", "cert", "key") for part in (f"--tls-{name}", "nothing.pem")]
ALONE = "--tls-ca-file, --tls-cert and --tls-key: must be given together"
SCHEMA = ["config", "schema"]
# For each argument of each command: the command without it, with it, and CHANGES or the words of a refusal.
OF_RUNS = {
    "json": (["--json"], CHANGES),
    "quiet": (["--quiet"], CHANGES),
    "open": (["--open"], CHANGES),
    "executor": (["--executor", "dask"], "--executor dask needs --scheduler ADDRESS"),
    "scheduler": (DASK, CHANGES),
    "tls_ca_file": ([*DASK, *TLS[:2]], ALONE),
    "tls_cert": ([*DASK, *TLS[2:4]], ALONE),
    "tls_key": ([*DASK, *TLS], r"--scheduler tcp://host:1: must begin with tls:// if certificates are given"),
    "device": (["--device", "cpu"], CHANGES),
    "tensorboard": (["--tensorboard"], CHANGES),
}
OF_PRODUCTS = {
    "directory": (["elsewhere"], CHANGES),
    "task": (["--task", "mine.py:Mine"], "this run's task, detection, is built in: leave --task out"),
    "out": (["--out", "there"], CHANGES),
    "json": (["--json"], CHANGES),
    "quiet": (["--quiet"], CHANGES),
}
OF_ONE = {"candidate": (["--candidate", "0"], CHANGES), "seed": (["--seed", "3"], CHANGES)}
OPEN = {"open": (["--open"], CHANGES)}
DAMAGE = {"before_damage": (["--before-damage"], CHANGES)}  # in a run with a damaged record
FILMS = {name: ([f"--{name}"], CHANGES) for name in ("rrd", "gif", "mp4")}
JSON = {"json": (["--json"], CHANGES)}
SETTINGS = {
    "task": (["tracking"], CHANGES),
    "preset": (["--preset", "quick"], CHANGES),
    "scale": (["--scale", "laptop"], "scale"),
    "config": (["--config", "settings.toml"], CHANGES),
    "set": (["--set", "seed=4"], CHANGES),
}
TABLE = {
    "run": {
        **SETTINGS,
        **OF_RUNS,
        "seed": (["--seed", "4"], CHANGES),
        "workers": (["--workers", "2"], CHANGES),
        "out": (["--out", "other"], CHANGES),
        "start_from": (["--from", "done"], CHANGES),
        "dry_run": (["--dry-run"], CHANGES),
    },
    "resume": {"directory": (["done"], CHANGES), "task": OF_PRODUCTS["task"], **DAMAGE, **OF_RUNS},
    "status": {"directory": (["begun"], CHANGES), **DAMAGE, **JSON, "watch": (["--json", "--watch"], CHANGES)},
    "list": {"directory": (["empty"], CHANGES), **JSON},
    "compare": {"directories": (["begun"], CHANGES), **DAMAGE, **JSON, "html": (["--html", "page.html"], CHANGES)},
    "drift": {"directories": (["again"], CHANGES), "searches": (["--searches", "3"], CHANGES), **DAMAGE, **JSON},
    "replay": {
        **OF_PRODUCTS,
        **DAMAGE,
        **OF_ONE,
        **OPEN,
        **{name: ([f"--{name}"], CHANGES) for name in ("test", "rrd", "gif", "mp4")},
        "every": (["--every", "4"], CHANGES),  # test_run_products: refused without --rrd
    },
    "report": {**OF_PRODUCTS, **DAMAGE, **OPEN},
    "export": {**OF_PRODUCTS, **DAMAGE, **OF_ONE, "every": (["--every", "4"], CHANGES)},
    "demo": {"out": (["--out", "there"], CHANGES), **OPEN, **JSON, "quiet": (["--quiet"], CHANGES)},
    "see": {
        "photograph": (["other.png"], CHANGES),
        "animal": (["--animal", "eagle"], CHANGES),
        "width_deg": (["--width-deg", "30"], CHANGES),
        "uv": (["--uv", "0"], CHANGES),
        "depth": (["--depth", "0.01"], CHANGES),
        "out": (["--out", "there"], CHANGES),
    },
    "validate": {"proofs": (["aliasing"], CHANGES), "list": (["--list"], CHANGES)},
    "doctor": JSON,
    "tasks": JSON,
    "presets": JSON,
    "genes": JSON,
    "config": {"what": (["schema"], CHANGES), **SETTINGS},
    "completion": {"shell": (["zsh"], CHANGES)},
}
BASE = {
    "run": RUN,
    "resume": RESUME,
    "status": ["status", "done"],
    "list": ["list", "."],
    "compare": ["compare", "done"],
    "drift": ["drift", "--searches", "2", "done"],
    "replay": ["replay", "done"],
    "report": ["report", "done"],
    "export": ["export", "done"],
    "demo": ["demo"],
    "see": ["see", "photo.png", "--animal", "mouse", "--width-deg", "20"],
    "config": ["config", "show", "detection"],
    "completion": ["completion", "bash"],
}
# Positional arguments replace those of the base command.
POSITIONAL = {"directory": 1, "what": 1, "shell": 1, "photograph": 1}
NO_PLAN = {name: (given, PLAN) for name, (given, _) in OF_RUNS.items() if name in ("quiet", "open", "tensorboard")}
MORE = [  # an argument next to others, which it contradicts
    *((DRY, given, words) for given, words in NO_PLAN.values()),
    (DRY, DASK, PLAN),
    ([*RUN, *DASK], ["--workers", "2"], "--workers: is for this machine's processes"),
    *((SCHEMA, given, "must be left out with schema") for given, _ in SETTINGS.values()),
    (RUN, TLS, "--executor dask needs --scheduler ADDRESS"),
]
