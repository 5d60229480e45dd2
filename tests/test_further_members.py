"""What is left to ``--everything`` is there, and a quicker member of the same function stands for it."""


def test_names_are_those_of_tests(left_to_everything):
    left_out, collected = left_to_everything
    assert not left_out - collected


def test_no_function_is_left_out_whole(left_to_everything):
    left_out, collected = left_to_everything
    standing = {name.split("[")[0] for name in collected - left_out}
    assert not {name.split("[")[0] for name in left_out} - standing
