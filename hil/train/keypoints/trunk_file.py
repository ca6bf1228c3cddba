"""The shipped trunk as PyTorch weights with batch normalisation folded in or restored, and trained trunks as ONNX."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import onnx
import torch
from onnx import numpy_helper
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_PX
from flyaround.hil.train.keypoints.network import Trunk

if TYPE_CHECKING:
    from collections.abc import Iterable

    from torch import Tensor

# ONNX operator set that OpenCV 4.6 reads.
OPERATORS_VERSION = 11


def fold(trunk: Trunk) -> Trunk:
    """Fold every batch normalisation of a trunk into the preceding convolution.

    Returns
    -------
    Trunk
        The same trunk, changed in place and in evaluation mode.
    """
    trunk = trunk.eval()
    trunk.body = _fold_layers(trunk.body)
    return trunk


def to_onnx(trunk: Trunk) -> bytes:
    """Serialise a folded trunk as ONNX.

    Returns
    -------
    bytes
        ONNX file with half-precision weights, which OpenCV evaluates in single precision. ``trunk`` itself is converted
        to half precision, too.
    """
    data = io.BytesIO()
    example = torch.zeros(1, 2, INPUT_PX, INPUT_PX).half()
    torch.onnx.export(
        trunk.half(),
        (example,),
        data,
        input_names=["image"],
        output_names=["features"],
        dynamic_axes={"image": {0: "n"}, "features": {0: "n"}},
        opset_version=OPERATORS_VERSION,
        dynamo=False,
    )
    return data.getvalue()


def from_onnx(data: bytes) -> Trunk:
    """Read the trunk of an ONNX file written by ``to_onnx``.

    Returns
    -------
    Trunk
        Folded trunk in single precision and evaluation mode.
    """
    trunk = fold(Trunk())
    weights = {
        w.name: torch.from_numpy(numpy_helper.to_array(w).copy()).float()
        for w in onnx.load_from_string(data).graph.initializer
    }
    trunk.load_state_dict(weights)
    return trunk


def unfold(trunk: Trunk, inputs: Tensor) -> Trunk:
    """Return a trainable trunk, with batch normalisation, whose outputs equal those of a folded one.

    Parameters
    ----------
    trunk : Trunk
        Folded trunk.
    inputs : (B, 2, S, S) tensor
        Samples, whose statistics initialise the batch normalisation.

    Returns
    -------
    Trunk
        New trunk in evaluation mode.
    """
    out = Trunk().eval()
    with torch.no_grad():
        _restore(trunk.body, list(out.body), inputs)
    return out


def _restore(folded_layers: Iterable[nn.Module], layers: list[nn.Module], x: Tensor) -> Tensor:
    """Copy folded layers into layers with batch normalisation, and return their output."""
    sources = iter(folded_layers)
    for k, layer in enumerate(layers):
        if isinstance(layer, nn.BatchNorm2d):
            continue
        source = next(sources)
        if isinstance(layer, nn.Conv2d):
            layer.weight.copy_(source.weight)
            y, norm = layer(x), layers[k + 1]
            norm.running_mean.copy_(y.mean((0, 2, 3)))
            norm.running_var.copy_(y.var((0, 2, 3)))
            norm.weight.copy_((norm.running_var + norm.eps).sqrt())
            norm.bias.copy_(source.bias + norm.running_mean)
            x = source(x)
        elif isinstance(getattr(layer, "body", None), nn.Sequential):
            x = torch.relu(x + _restore(source.body, list(layer.body), x))
        else:
            x = layer(x)
    return x


def _fold_layers(layers: Iterable[nn.Module]) -> nn.Sequential:
    out: list[nn.Module] = []
    for layer in layers:
        if isinstance(layer, nn.BatchNorm2d) and isinstance(out[-1], nn.Conv2d):
            out[-1] = fuse_conv_bn_eval(out[-1], layer)
            continue
        if isinstance(getattr(layer, "body", None), nn.Sequential):
            layer.body = _fold_layers(layer.body)
        out.append(layer)
    return nn.Sequential(*out)
