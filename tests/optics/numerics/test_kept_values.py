"""Kept values are computed once, and the one whose last use is longest ago is dropped."""

from optics.numerics.kept_values import KeptValues


def test_a_value_is_computed_once():
    kept, computed = KeptValues(2), []
    for _ in range(3):
        assert kept.get("a", lambda: computed.append("a") or 7) == 7
    assert computed == ["a"]


def test_the_least_recently_used_value_is_dropped():
    kept = KeptValues(2)
    for key in "abac":  # drops b
        kept.get(key, lambda key=key: key.upper())
    assert len(kept) == 2
    assert [kept.get(key, lambda: "again") for key in "acb"] == ["A", "C", "again"]
