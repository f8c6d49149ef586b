"""XML of model files: elements with their lines; entities and external documents are rejected.

Some violations of XML that other readers of robots accept are tolerated: white space before the declaration, prefixes
without a namespace, ``--`` in comments. `Document.slips` lists them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax import SAXException, SAXParseException
from xml.sax.handler import ContentHandler

import defusedxml.sax
from defusedxml import DefusedXmlException

import uqmbd

__all__ = ["Document", "XmlElement", "parse", "prefix"]

NESTED = 500
"""Largest depth of nested elements; robots have chains of joints, not of nested elements."""

LARGEST = 200_000_000
"""Largest size of a file, bytes."""

BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class XmlElement:
    """Element with its first line in the file."""

    tag: str
    attrib: dict[str, str]
    line: int
    children: list[XmlElement] = field(default_factory=list)

    def __iter__(self) -> Iterator[XmlElement]:
        return iter(self.children)

    def get(self, key: str, default: str = "") -> str:
        """Return an attribute, or the default."""
        return self.attrib.get(key, default)

    def find(self, tag: str) -> XmlElement | None:
        """Return the first child with a tag."""
        return next(iter(self.findall(tag)), None)

    def findall(self, tag: str) -> list[XmlElement]:
        """Return the children with a tag."""
        return [x for x in self.children if x.tag == tag]

    def everything(self) -> Iterator[XmlElement]:
        """Yield the element and all its descendants."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


@dataclass(frozen=True)
class Document:
    """A parsed file."""

    path: str
    root: XmlElement
    slips: tuple[str, ...]  # tolerated violations of XML


def parse(where: str, path: str, form: str, opaque: frozenset[str] = frozenset()) -> Document:
    """Return the XML document in a file.

    `where`: start of messages; `path`: path of the file; `form`: name of the format, for messages; `opaque`: tags of
    elements whose content is ignored. Raise StudyError, with the line, if the file is missing or not XML.
    """
    file = Path(path)
    try:
        if file.is_dir():
            raise uqmbd.StudyError(f"{where} is a folder; expected a file, such as {file / ('robot.' + form)}.")
        if file.exists() and not file.is_file():
            raise uqmbd.StudyError(f"{where} is a pipe or a device; expected a file.")
        if file.stat().st_size > LARGEST:
            raise uqmbd.StudyError(
                f"{where} has {file.stat().st_size:,} bytes; expected a file of at most {LARGEST:,}."
            )
        text = file.read_bytes()
    except (OSError, ValueError) as error:
        article = "an" if form == "mjcf" else "a"  # the letter M is pronounced "em"
        reason = "there is no such file" if isinstance(error, FileNotFoundError) else str(error)
        raise uqmbd.StudyError(f"{where}: {reason}; expected the path of {article} {form.upper()} file.") from None
    slips: list[str] = []
    text, before = _without_leading_space(text, slips)
    text = _without_dashes(text, slips)
    builder = _Builder(before, opaque, slips)
    try:
        defusedxml.sax.parseString(text, builder)
    except DefusedXmlException as error:
        what = "an entity" if "Entit" in type(error).__name__ else "another document"
        raise uqmbd.StudyError(
            f"{where}: line {builder.line} declares or refers to {what} ({_shown(error)}). For security, from_urdf "
            "and from_mjcf do not expand entities, which can grow without limit and read other files. Replace the "
            "reference by its text."
        ) from None
    except _TooDeep:
        raise uqmbd.StudyError(
            f"{where}: line {builder.line}: elements are nested more than {NESTED} levels deep; expected a model file."
        ) from None
    except SAXParseException as error:
        line = (error.getLineNumber() or 0) + before
        raise uqmbd.StudyError(f"{where} is not valid XML: line {line}: {error.getMessage()}.") from None
    except (SAXException, ValueError, LookupError) as error:
        raise uqmbd.StudyError(f"{where} is not valid XML: {' '.join(str(error).split())}.") from None
    if builder.root is None:
        raise uqmbd.StudyError(f"{where} is not valid XML: it contains no element.")
    return Document(path, builder.root, tuple(dict.fromkeys(slips)))


def prefix(tag: str) -> str:
    """Return the prefix of a name, or an empty text.

    >>> prefix("drake:member"), prefix("link")
    ('drake', '')
    """
    return tag.rpartition(":")[0]


class _TooDeep(Exception):
    """Error: elements are nested too deeply."""


def _without_leading_space(text: bytes, slips: list[str]) -> tuple[bytes, int]:
    """Remove white space before the first element, and count its lines."""
    mark = BYTE_ORDER_MARK if text.startswith(BYTE_ORDER_MARK) else b""
    rest = text[len(mark) :]
    bare = rest.lstrip(b" \t\r\n")
    if len(bare) == len(rest) or not bare.startswith(b"<?xml"):
        return text, 0
    slips.append("white space before <?xml")
    return mark + bare, rest[: len(rest) - len(bare)].count(b"\n")


def _without_dashes(text: bytes, slips: list[str]) -> bytes:
    """Remove the text of comments that contain two dashes, but not their lines."""

    def without(found: re.Match[bytes]) -> bytes:
        inside = found.group(1)
        if b"--" not in inside and not inside.endswith(b"-"):
            return found.group()
        slips.append("-- in a comment")
        return b"<!--" + b"\n" * inside.count(b"\n") + b"-->"

    # searching for the end of each unterminated comment would take time quadratic in the size
    end = text.rfind(b"-->") + 3
    return re.sub(rb"<!--(.*?)-->", without, text[:end], flags=re.DOTALL) + text[end:] if end > 2 else text


def _shown(error: DefusedXmlException) -> str:
    name = getattr(error, "name", None) or getattr(error, "sysid", None)
    return str(name)[:60] if name else "without a name"


class _Builder(ContentHandler):
    """Builder of elements with their lines."""

    def __init__(self, before: int, opaque: frozenset[str], slips: list[str]) -> None:
        super().__init__()
        self.before = before
        self.opaque = opaque
        self.slips = slips
        self.root: XmlElement | None = None
        self.open: list[XmlElement] = []
        self.known: list[frozenset[str]] = [frozenset(("", "xml", "xmlns"))]
        self.closed = 0
        self.locator: Any = None

    @property
    def line(self) -> int:
        """Current line."""
        return self.before + int((self.locator.getLineNumber() if self.locator else 0) or 0)

    def setDocumentLocator(self, locator: Any) -> None:
        """Store the locator of lines."""
        self.locator = locator

    def startElement(self, name: str, attrs: Any) -> None:
        """Add an element, unless it is inside an ignored one."""
        given = dict(attrs.items())
        declared = {key.partition(":")[2] for key in given if key.startswith("xmlns:")}
        self.known.append(self.known[-1] | declared if declared else self.known[-1])
        unknown = {prefix(key) for key in (name, *given)} - self.known[-1]
        self.slips.extend(f"prefix {x!r} without a namespace" for x in sorted(unknown))
        if len(self.known) > NESTED:
            raise _TooDeep
        if self.closed:
            self.closed += 1
            return
        element = XmlElement(name, given, self.line)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)
        self.closed = int(name in self.opaque)

    def endElement(self, name: str) -> None:
        """Return to the parent element."""
        self.known.pop()
        if self.closed > 1:
            self.closed -= 1
            return
        self.closed = 0
        self.open.pop()

    def skippedEntity(self, name: str) -> None:
        """Raise an error for an undeclared entity."""
        raise SAXException(f"entity {name!r} is not declared")
