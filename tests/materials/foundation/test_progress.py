from __future__ import annotations

import logging

import pytest

from materials.foundation.progress import show_progress, stage, tracked


def test_tracking_changes_nothing_but_the_view(capsys):
    assert list(tracked(range(3), "counting")) == [0, 1, 2]
    assert capsys.readouterr().err == ""
    show_progress(True)
    try:
        assert list(tracked(iter("abc"), "spelling", total=3)) == ["a", "b", "c"]
    finally:
        show_progress(False)


def test_a_stage_says_how_long_it_took(caplog):
    with caplog.at_level(logging.INFO, logger="meniscus"), stage("meshing"):
        pass
    assert caplog.records[0].getMessage() == "meshing …"
    assert caplog.records[1].getMessage().endswith(" s")


def test_a_stage_that_fails_claims_no_time(caplog):
    def fail():
        with stage("meshing"):
            raise ValueError("no points")

    with caplog.at_level(logging.INFO, logger="meniscus"), pytest.raises(ValueError, match="no points"):
        fail()
    assert len(caplog.records) == 1
