"""Names that programs stumble over."""

NAUGHTY = (
    *("a b", "a.b", "a b 2", "A B", "a-b", "by lighting", "default", "tracker", "summary", "index", "CON"),
    *("nul", ".hidden", "=1+1", "+1", "-1", "@x", "-", "=cmd|' /C calc'!A0", "\t=1", "1e5", "0x10", "NaN"),
    *("null", "None", "true", "-0.0", "\x1b[31mred", "bell\x07", "new\nline", "cr\rline", "tab\tname"),
    *("nul\x00name", "\x7f", "\x85", "\u2028", "\x1b]0;t\x07", "\udcff\udcfe", "latin-\udce9"),
    *("\u202egnp.exe", "\u2066x", "\ufeffbom", "\ufffe", "zero\u200bwidth", "e\u0301", "\xe9"),
    *("\U0001f600", "\U0001f468\u200d\U0001f469\u200d\U0001f467", "\u8ddf\u8e2a", "\u8e2a", "\u0627\u0644"),
    *("\u0e01\u0e33", "\U000e0041", "x" * 255, "x" * 254 + "y", "\U0001f600" * 63, "\u00e9" * 127),
    *("/".join(["deep"] * 60), "w " * 100, "%41", "%", "a%2Fb", "<script>alert(1)</script>"),
    *("</script><b>", "<!--", "]]>", "&amp;", "\"'`$(id)", "'; DROP TABLE", "{scene}", "{0}", "%s%n"),
    *("a[0].b", "a\\.b", "\\", "\\x1b", "[2]*", "*", "_&#~^", "$x$", "a,b;c", '"quoted"', "--help", "-rf"),
    *("~", "..x", "@", "@r90", "__proto__", "constructor", "toString", "hasOwnProperty", "datum"),
    *("undefined", "function(){}", " ", "  lead", "trail "),
)
