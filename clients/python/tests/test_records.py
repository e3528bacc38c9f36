"""Records checked as a stranger would: the signature by the sample in docs/records.md, the deals by their formulas."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from deal_check import check_deals

ROOT = Path(__file__).resolve().parents[3]
SIGNED = ROOT / "tests/fixtures/signed.jsonl"
# The key of the fixture, whose secret stands in a test.
KEY = "ed25519:ea4a6c63e29c520abef5507b132ec5f9954776aebebe7b92421eea691446d22c"


@pytest.fixture(scope="module")
def signed_by() -> Callable[[str], str | None]:
    """The function of the sample."""
    docs = (ROOT / "docs/records.md").read_text(encoding="utf-8")
    (sample,) = re.findall(r"```python\n(.*?)```", docs, re.DOTALL)
    namespace: dict[str, Any] = {"__name__": "sample"}
    exec(compile(sample, "docs/records.md", "exec"), namespace)
    function: Callable[[str], str | None] = namespace["signed_by"]
    return function


def test_a_stranger_can_check_a_signature(signed_by: Callable[[str], str | None], tmp_path: Path) -> None:
    assert signed_by(str(SIGNED)) == KEY
    text = SIGNED.read_bytes()
    forged = tmp_path / "forged.jsonl"
    for old, new in [
        (b'"Greta"', b'"Rosa"'),
        (b'"seat":3,"action":141', b'"seat":3,"action":140'),
        (b'"decisions":"207"', b'"decisions":"208"'),
    ]:
        assert old in text
        forged.write_bytes(text.replace(old, new))
        assert signed_by(str(forged)) is None
    assert signed_by(str(ROOT / "tests/fixtures/records/committed.jsonl")) is None, "it is unsigned"


def test_a_stranger_can_deal_a_record_again(tmp_path: Path) -> None:
    assert check_deals(str(SIGNED)) == 3
    text = SIGNED.read_text(encoding="utf-8")
    forged = tmp_path / "forged.jsonl"
    for old, new, problem in [
        ('"cards":[2,4,4,5,', '"cards":[3,4,4,5,', "Shift 1 was not dealt from the seed"),
        ('"seatEntropy":["","","cAYQ', '"seatEntropy":["","","dAYQ', "Shift 1 was not dealt from the seed"),
        ('"serverSeed":"9GRk', '"serverSeed":"8GRk', "did not keep to its commitment"),
    ]:
        assert old in text
        forged.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(AssertionError, match=problem):
            check_deals(str(forged))
