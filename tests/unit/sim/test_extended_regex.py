import pytest

from throwcollect.sim.extended_regex import ExtendedRegex


@pytest.mark.parametrize(
    ("pattern", "matching", "others"),
    [
        ("", ["", "a"], []),
        ("a", ["a", "bar"], ["", "b"]),
        ("^ab$", ["ab"], ["aab", "abb"]),
        ("a.c", ["abc", "a.c"], ["ac"]),
        (r"a\.c", ["a.c"], ["abc"]),
        ("^ab*c$", ["ac", "abc", "abbbc"], ["adc"]),
        ("^ab+c$", ["abc", "abbc"], ["ac"]),
        ("^ab?c$", ["ac", "abc"], ["abbc"]),
        ("^a{2}$", ["aa"], ["a", "aaa"]),
        ("^a{2,}$", ["aa", "aaaa"], ["a"]),
        ("^a{1,3}$", ["a", "aaa"], ["", "aaaa"]),
        ("^a{0}$", [""], ["a"]),
        ("^(ab|c)+$", ["ab", "cabc"], ["", "a", "ba"]),
        ("^(a|b|cd)$", ["a", "b", "cd"], ["c", "d", "acd"]),
        ("^(a*)*b$", ["b", "aab"], ["aa"]),
        ("a|^b$|", ["b", "anything"], []),
        ("^[abc]$", ["a", "c"], ["d", "ab"]),
        ("^[^abc]$", ["d", "^"], ["a"]),
        ("^[a-c0-9_]+$", ["b7_"], ["d"]),
        ("^[]a]$", ["]", "a"], ["["]),
        ("^[^]a]$", ["b"], ["]", "a"]),
        ("^[a-]$", ["a", "-"], ["b"]),
        ("^[[:alpha:]_][[:alnum:]_]*$", ["_a1", "Ω"], ["1a"]),
        ("^[[:upper:][:digit:]]$", ["A", "5"], ["a", ":"]),
        ("^[[.-.][=a=]]$", ["-", "a"], ["="]),
        ("x(^|y)z", ["xyz"], ["xz"]),
    ],
)
def test_expressions_mean_what_posix_says(pattern, matching, others):
    regex = ExtendedRegex(pattern)
    assert [text for text in matching + others if regex.search(text)] == matching


@pytest.mark.parametrize(
    ("pattern", "words"),
    [
        ("(", r"character 2: unmatched \("),
        (")", r"character 1: unmatched \)"),
        ("*a", r"nothing before \* to repeat"),
        ("(+)", r"nothing before \+ to repeat"),
        ("a{", "expected {m}"),
        ("a{,3}", "expected {m}"),
        ("a{3,2}", "should rise"),
        ("a{256}", "at most 255"),
        ("a{²}", "expected {m}"),
        ("[a", "ends too early"),
        ("[b-a]", "range b-a is empty"),
        ("[[:letter:]]", "unknown class"),
        ("[[.ab.]]", "one character"),
        ("\\", "ends too early"),
        (r"\d", r"\\d is not part of"),
        ("a" * 257, "257 characters; at most 256"),
        ("((a{1,255}){1,255}){1,255}", "multiply to more than 1000 parts"),
        ("((){255}){255}{255}{255}", "multiply to more than 1000 parts"),
    ],
)
def test_what_is_none_is_refused(pattern, words):
    with pytest.raises(ValueError, match=words):
        ExtendedRegex(pattern)


@pytest.mark.parametrize(
    "pattern", ["^(a+)+$", "^(a|a)*$", "^((a*)*)*$", "^(a?){100}a{100}$", "(" * 127 + "a" + ")" * 127 + "b"]
)
def test_what_would_be_tried_for_ever_is_decided(pattern):
    assert not ExtendedRegex(pattern).search("a" * 200 + "c")
