from __future__ import annotations

import pickle

import pytest

from materials.foundation.errors import InputError


def test_a_message_says_file_key_condition_value_and_remedy():
    error = InputError("be positive", got=-1, file="a.json", key="frames[3].exposure", remedy="Mend the file.")
    assert str(error) == "a.json: frames[3].exposure must be positive, got -1. Mend the file."


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"key": "g"}, "g must be right."),
        ({"file": "a.png"}, "a.png: it must be right."),
        ({"key": "g", "got": ""}, "g must be right, got ''."),
        ({"key": "g", "got": 0}, "g must be right, got 0."),
    ],
)
def test_a_part_that_does_not_apply_leaves_no_trace(parts, message):
    assert str(InputError("be right", **parts)) == message


def test_a_long_value_is_shortened_to_one_line():
    message = str(InputError("be short", got="line\n" * 1000, key="text"))
    assert "\n" not in message
    assert len(message) < 200


def test_a_place_is_filled_in_where_it_is_unknown_and_kept_where_it_is_known():
    error = InputError("be right", key="fx").at(file="a.json", key="other")
    assert str(error) == "a.json: fx must be right."


def test_an_error_crosses_the_border_of_a_process_unchanged():
    error = InputError("be right", got=[1, 2], file="a.json", key="fx", remedy="Mend it.")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
