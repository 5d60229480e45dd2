"""Tables as text: their columns stand below each other, and long ones cost little beside what they hold."""

import time

from varcalc.tables import table


def test_words_stand_to_the_left_and_numbers_to_the_right():
    drawn = table(("k", "status"), ("value",), [("1", "solved", "0.25"), ("10", "refused", "")], notes=["why"])
    assert drawn == "k    status    value\n────────────────────\n1    solved     0.25\n10   refused\n\nwhy"


def test_characters_that_are_twice_as_wide_take_two_columns():
    drawn = table(("name",), ("n",), [("経路", "1", "x"), ("path", "2", "y")], last=("of",))
    assert drawn.splitlines()[2:4] == ["経路   1   x", "path   2   y"]


def test_a_long_table_is_drawn_within_a_second():
    def seconds():
        begun = time.process_time()
        lines = table(("k", "status"), ("value",), [(str(k), "solved", str(k / 8)) for k in range(20_000)]).splitlines()
        assert len(lines) == 20_002
        return time.process_time() - begun

    assert any(seconds() < 1 for _ in range(4))  # one of a busy processor's may take longer
