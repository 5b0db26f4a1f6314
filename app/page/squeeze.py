"""Takes comments and needless spaces out of our own modules, and nothing else: no name changes."""

import re

STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'')
REGEX = re.compile(r"/(?![/*])(?:[^/\\\n\[]|\\.|\[(?:[^\]\\\n]|\\.)*\])+/[a-z]*")
COMMENT = re.compile(r"//[^\n]*|/\*(?:[^*]|\*(?!/))*\*/")
WORD = re.compile(r"[\w$]+")
SPACE = re.compile(r"\s+")
CANNOT_END, CANNOT_BEGIN = ";{,([:?&|=*<>", "})].,;:?&|=*<>"  # a statement
BEFORE_REGEX = "(,=&|!?:;{"  # after these a slash begins a regular expression


def squeeze(text: str) -> str:
    """JavaScript with the same tokens; line ends stay where a statement may end."""
    return _code(text, 0, end="")[0]


def _code(text: str, at: int, end: str) -> tuple[str, int]:
    """Code from `at` to its end, or to the brace that closes a template's `${`; and where it is."""
    out: list[str] = []
    depth = 0
    while at < len(text):
        if found := COMMENT.match(text, at) or SPACE.match(text, at):
            _space(out, "\n" if "\n" in found[0] and found[0][0] != "/" else " ")
        elif found := STRING.match(text, at) or WORD.match(text, at):
            _token(out, found[0])
        elif text[at] == "/" and _last(out) in BEFORE_REGEX and (found := REGEX.match(text, at)):
            _token(out, found[0])
        elif text[at] == "`":
            template, at = _template(text, at + 1)
            _token(out, template)
            continue
        else:
            depth += {"{": 1, "}": -1}.get(text[at], 0)
            if end and depth < 0:
                return "".join(out).strip(), at
            _token(out, text[at])
            at += 1
            continue
        at = found.end()
    return "".join(out).strip() + "\n", at


def _template(text: str, at: int) -> tuple[str, int]:
    """A template literal whose inside begins at `at`, and where what follows it begins.

    One of several lines is GLSL and squeezed, too; one of a single line is a text and stays.
    """
    parts: list[str] = []  # texts and codes by turns
    start = at
    while text[at] != "`":
        if text.startswith("${", at):
            parts.append(text[start:at])
            code, at = _code(text, at + 2, end="}")
            parts.append("${" + code + "}")
            start = at + 1
        at += 2 if text[at] == "\\" else 1
    parts.append(text[start:at])
    if any("\n" in part for part in parts[::2]):
        parts[::2] = [_glsl(part) for part in parts[::2]]
    return "`" + "".join(parts) + "`", at + 1


def _glsl(text: str) -> str:
    text = re.sub(r"[ \t]*//[^\n]*", "", text)
    text = re.sub(r"\s*\n\s*", "\n", text)
    return re.sub(r" ?([=+*/<>?:,;{}()&|]+) ?", r"\1", text)


def _space(out: list[str], kind: str) -> None:
    if out and out[-1] != "\n":  # never at the very beginning
        if out[-1] == " ":
            out.pop()
        out.append(kind)


def _last(out: list[str]) -> str:
    """The last letter that is no space; a bracket at the very beginning."""
    return next((part[-1] for part in reversed(out) if part.strip()), "(")


def _token(out: list[str], token: str) -> None:
    """Appends one, and drops the space before it where nothing would run together; a line end too,
    where a statement cannot end there.
    """
    if out and out[-1] == "\n" and (token[0] in CANNOT_BEGIN or out[-2][-1] in CANNOT_END):
        out.pop()
    if out and out[-1] == " ":
        before = out[-2][-1] if len(out) > 1 else "\n"
        words = re.match(r"[\w$]", before) and re.match(r"[\w$\"'`]", token)
        signs = before in "+-" and token in "+-"
        if not (words or signs):
            out.pop()
    if out and (out[-1] + token[0] == ";}" or (out[-1] == "," and token[0] in ")]}")):
        out.pop()  # the last of a row or block needs none
    out.append(token)
