# SPDX-License-Identifier: MIT
"""Lists for `stemvo-lab export --list` the layers of a network, their filters, and which are used by the paper's search
and which not, with the totals of its Table 1. The paper does not say its rule; this one gives its numbers exactly on
Keras' own networks (docs/search.md): used are plain convolutions (class Conv2D, not separable, depthwise or transposed
ones); layers nested in others and dense ones do not count.

The rule is one for all files (Row.used); what they tell of a layer differs. A Keras file names its class, or has arrays of
its own for it. PyTorch's arrays show a depthwise convolution by its kernel of one plane, but not that a 1x1 convolution
follows one directly (Keras' separable convolution), which a whole .onnx does. Neither knows of nested layers.
"""

import dataclasses

from . import graph_cut, graph_kinds, weight_files, weights


_DENSE = ("dense", "Gemm", "MatMul")  # units, not filters


@dataclasses.dataclass(frozen=True)
class Row:
    name: str
    kind: str
    filters: int | None  # None: the file does not say
    outer: str = ""  # a nested layer counts with the one it is in

    @property
    def used(self):
        """By the paper's search."""
        return self.kind == "convolution" and not self.outer

    @property
    def counted(self):
        """Its filters, in the totals."""
        return 0 if self.kind in _DENSE else self.filters or 0


def read(path, size=None):
    """The layers of weights, .npz or .onnx. Where a file holds arrays only, layers without weights are not in it; of a graph: all nodes
    that give a tensor, for pictures of `size` (width, height)."""
    if path.suffix == ".npz":
        return [Row("stem", "convolution", weights.load(path, "none").filters)]
    if path.suffix != ".onnx":
        return [Row(layer.name, layer.kind or "no weights", layer.filters, layer.outer) for layer in weight_files.load(path).layers]
    with graph_cut.refusing_unsound(path):
        model = graph_cut.read(path)
        kinds = graph_kinds.kinds_of(model)
        layers = graph_cut.layers_at(path, model, size or (256, 256))
    return [Row(node.output[0], kinds.get(node.output[0], node.op_type), filters) for node, filters in layers
            if filters is not None and node.op_type not in ("Constant", "Identity", "Shape")]


def totals(rows):
    """Layers, filters, those that are used, those that are not: the paper's Table 1."""
    rows = [row for row in rows if not row.outer]
    used, filters = (sum(row.counted for row in rows if row.used or not only) for only in (True, False))
    return len(rows), filters, used, filters - used


def text(rows):
    """The table, and the totals."""
    width = max((len(row.name) for row in rows), default=4)
    lines = [f"{'layer':{width}}  {'kind':15}  filters  used"]
    for row in rows:
        use = f"in {row.outer}" if row.outer else "yes" if row.used else "no"
        lines.append(f"{row.name:{width}}  {row.kind:15}  {'-' if row.filters is None else row.filters:>7}  {use}")
    layers, filters, used, others = totals(rows)
    unknown = sum(row.filters is None for row in rows if not row.outer)
    lines.append(f"layers {layers}, filters {filters}, used {used} (in {sum(row.used for row in rows)} convolutions), not used {others}" + (f"; {unknown} layers whose filters the file does not say" if unknown else ""))
    return "\n".join(lines)
