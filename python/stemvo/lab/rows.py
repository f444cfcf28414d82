# SPDX-License-Identifier: MIT
"""A CSV file that only grows: what is in it is not computed again."""

import csv
import fcntl
import io
import os
import pathlib


class Rows:
    """Rows of strings by their key. What a kill tore off the last line is cut away. Others' files may be read beside it."""

    def __init__(self, file, columns, num_key, others=()):
        self.columns, self._num_key, self._rows = columns, num_key, {}
        for other in others:
            self._read(pathlib.Path(other).read_text(encoding="utf-8"), other)
        self._stream = open(file, "a+", encoding="utf-8", newline="")
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f"{file}: expected to be its only writer, found another one") from None
        self._stream.seek(0)
        whole, line_end, _ = self._stream.read().rpartition("\n")
        self._stream.truncate(len((whole + line_end).encode()))
        if whole:
            self._read(whole, file)
        else:
            self._write([columns])

    def _read(self, text, file):
        reader = csv.reader(io.StringIO(text))
        if (found := tuple(next(reader, ()))) != self.columns:
            raise ValueError(f"{file}: expected the columns {','.join(self.columns)}, found {','.join(found)}")
        for cells in reader:
            if len(cells) != len(self.columns):
                raise ValueError(f"{file}:{reader.line_num}: expected {len(self.columns)} columns, found {len(cells)}")
            self._rows.setdefault(tuple(cells[: self._num_key]), dict(zip(self.columns, cells)))

    def _write(self, rows):
        csv.writer(self._stream, lineterminator="\n").writerows(rows)
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def append(self, rows):
        """On the disk when this returns. Values become text as str() has them; None is empty."""
        made = [["" if row[name] is None else str(row[name]) for name in self.columns] for row in rows]
        self._write(made)
        for cells in made:
            self._rows[tuple(cells[: self._num_key])] = dict(zip(self.columns, cells))

    def get(self, key):
        return self._rows.get(tuple(map(str, key)))
