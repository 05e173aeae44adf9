"""TOML within bounds: what is refused is refused quickly, and what is hidden from a quick look is found."""

import pytest

from tracknoise.text import parse_toml

MANY = "a." * 50_000
HIDDEN = [
    MANY + "b = 1",
    f"[{MANY}b]",
    '"#".' * 50_000 + "b = 1",
    f'"a\\"" . {MANY}" = 1',
    f'x = {{ a = """\n""", {MANY}b = 1 }} # "',
    f"x = {{ a = '''\n\"''', {MANY}b = 1 }} # \"",
]
HARMLESS = [
    f'a = "{MANY}"',
    f"# {MANY}",
    f"a = '''\n{MANY}\n'''",
    "a = [" + "0.5, " * 50_000 + "]",
    "".join(f"a.b{number} = 0.5\n" for number in range(10_000)),
]
WRONG = ['a = "' + '\\\\"' * 100_000, 'a = """' + '\\\\"' * 100_000, "a = " + "'" * 100_001, "a = " + "{b=" * 50_000]


@pytest.mark.parametrize("text", HIDDEN, ids=map(str, range(len(HIDDEN))))
def test_long_keys_are_refused_wherever_they_stand(text):
    with pytest.raises(ValueError, match=r"^line [12]: a key of 5000[012] parts, expected at most 16$"):
        parse_toml(text)


@pytest.mark.parametrize("text", HARMLESS, ids=map(str, range(len(HARMLESS))))
def test_texts_comments_and_numbers_may_have_many_dots(text):
    assert set(parse_toml(text)) <= {"a"}


@pytest.mark.parametrize("text", WRONG, ids=map(str, range(len(WRONG))))
def test_what_is_no_toml_is_one_line(text):
    with pytest.raises(ValueError, match="expected") as caught:
        parse_toml(text)
    assert len(str(caught.value).splitlines()) == 1
