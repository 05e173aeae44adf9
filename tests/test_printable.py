import sys
import unicodedata

from tracknoise.printable import is_printable, printable


def test_every_control_character_is_escaped_and_other_text_stays():
    for code in range(sys.maxunicode + 1):
        char = chr(code)
        if unicodedata.category(char) in {"Cc", "Cs", "Zl", "Zp"}:
            assert not is_printable(char), hex(code)
    assert printable("a\x1b[31m\n\x00\udcff\u202e\u2028") == "a\\x1b[31m\\n\\x00\\udcff\\u202e\\u2028"
    assert printable("a\tb\r\n", keep="\n\t") == "a\tb\\r\n"
    for text in ("plain", "\u00e4\u8ddf\u8e2a", "\U0001f468\u200d\U0001f469", "\u0627\u0644", "\\x1b"):
        assert is_printable(text)
        assert printable(text) == text
