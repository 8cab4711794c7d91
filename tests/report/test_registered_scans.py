"""The section on scans, and what it says of each."""

import re

from riemhuman.registration import ScanRecord
from riemhuman.report.registered_scans import scan_section


def record(name, *, trusted, message, share):
    return ScanRecord(name, trusted, message, 2.52, 0.002, share, {})


def test_scans_have_one_badge_of_three_and_no_likelihood():
    records = [
        record("ann", trusted=False, message="far from the scan", share=0.4),
        record("ben", trusted=True, message="the legs were not seen", share=0.66),
        record("cy", trusted=True, message="", share=0.97),
    ]
    html = scan_section(records).html
    assert re.findall(r'<strong class="badge (\w+)">([^<]*)<', html) == [
        ("untrusted", "not trusted"),
        ("partial", "partly trusted"),
        ("trusted", "trusted"),
    ]
    assert "likelihood" not in html
    assert "2.52" not in html
    assert "2 of 3 scans are registered and trusted; 1 of them only in part" in html
    assert "Scan inside the body: " in scan_section(records, units="in").html
