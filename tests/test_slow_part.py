"""Selection of the tests that are skipped by default; `--all` skips none."""

from itertools import product

import pytest
from hypothesis import settings

from tests.slow_part import FAST_EXAMPLES, fast_cases

SUITE = """
import pytest
from hypothesis import given, strategies as st
from tests.slow_part import sweep

@pytest.mark.slow
def test_slow(): pass

@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("one", "abc")
@pytest.mark.parametrize("other", "xy")
def test_cases(one, other): print("case:", one, other)

examples = []

@sweep(50)
@given(st.integers())
def test_sweep(number): examples.append(number)

def test_count(): print("examples:", len(examples))
"""


@pytest.fixture
def profile():
    """The inner run loads a hypothesis profile; the outer run continues with its own."""
    before = settings.get_current_profile_name()
    yield
    settings.load_profile(before)


@pytest.mark.usefixtures("profile")
@pytest.mark.parametrize(
    ("options", "passed", "examples"), [((), 4, FAST_EXAMPLES), (("--all",), 9, 50), (("-m", "slow"), 5, None)]
)
def test_slow_tests_run_on_demand(pytester, options, passed, examples):
    pytester.makepyfile(SUITE)
    pytester.makeini("[pytest]\naddopts = -m 'not slow' --strict-markers\nmarkers =\n  slow: s\n  fast_cases(n): f\n")
    result = pytester.runpytest_inprocess("-p", "tests.slow_part", "-s", *options)
    assert result.parseoutcomes()["passed"] == passed
    if examples:
        result.stdout.fnmatch_lines([f"*examples: {examples}*"])
    if not options:
        result.stdout.fnmatch_lines(["*case: a x*", "*case: b y*"])


def test_fast_cases_hold_as_many_values_as_they_can():
    cases = [{"shape": shape, "method": method} for shape, method in product(range(3), range(4))]
    chosen = [cases[place] for place in fast_cases(cases, 4)]
    assert {case["shape"] for case in chosen} == {0, 1, 2}
    assert {case["method"] for case in chosen} == {0, 1, 2, 3}
    assert sorted(fast_cases(cases, 100)) == list(range(12))
    assert fast_cases([{"seed": seed} for seed in range(30)], 2) == [0, 1]
