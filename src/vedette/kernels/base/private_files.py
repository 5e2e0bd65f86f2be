"""Files that no other user can have written, as unpickling runs code.

A place is private if only this user, root and the owner of the source (whose code runs anyway) can write there. On
systems without owners and modes every place counts as private.
"""

import os
import stat
from functools import cache
from pathlib import Path

_OWNED = os.name == "posix"
_OUTSIDE_NAMESPACE = 65534  # owner of outer folders as seen inside a user namespace (a container)


def make_private_folder(folder: Path) -> None:
    """Create a folder and missing parents for this user only. Raises `OSError` if that is impossible."""
    for part in (*reversed(folder.parents), folder):
        if not part.exists():
            part.mkdir(mode=0o700, exist_ok=True)


def folder_fault(folder: Path, source: Path) -> str | None:
    """Return why other users can write into the folder or replace it, checking from the top, or None if they cannot.

    folder: resolved, without links. source: file whose owner is trusted. Raises `OSError` if one does not exist.
    """
    if not _OWNED:
        return None
    owners = _trusted_owners(source)
    for part in (*reversed(folder.parents), folder):
        status = part.stat()
        above = part != folder
        if status.st_uid not in owners and not (above and status.st_uid == _OUTSIDE_NAMESPACE):
            return f"{part} belongs to another user"
        # In a sticky folder such as /tmp other users cannot rename our files.
        if _others_can_write(status) and not (above and status.st_mode & stat.S_ISVTX):
            return f"others can write to {part}"
    return None


def read_private(path: Path, source: Path) -> bytes | None:
    """Return the content of a file, or None if it does not exist or other users can have written it."""
    try:
        with path.open("rb") as file:
            if _OWNED:
                status = os.fstat(file.fileno())
                if status.st_uid not in _trusted_owners(source) or _others_can_write(status):
                    return None
            return file.read()
    except OSError:
        return None


def write_private(path: Path, content: bytes) -> None:
    """Write a new file that only this user can read or write. Raises `OSError`, also if it exists."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o600), "wb") as to:
        to.write(content)


@cache
def _trusted_owners(source: Path) -> frozenset[int]:
    try:
        return frozenset({0, os.getuid(), source.stat().st_uid})
    except OSError:  # the source was typed in a notebook
        return frozenset({0, os.getuid()})


def _others_can_write(status: os.stat_result) -> bool:
    group_can = status.st_mode & stat.S_IWGRP and not _is_own_group(status.st_gid)
    return bool(status.st_mode & stat.S_IWOTH or group_can)


@cache
def _is_own_group(group_id: int) -> bool:
    """Return True if the group is the private group of this user, without other members."""
    import grp
    import pwd

    try:
        user, group = pwd.getpwuid(os.getuid()), grp.getgrgid(group_id)
    except KeyError:
        return False
    return group.gr_gid == user.pw_gid and group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}
