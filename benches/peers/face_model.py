#!/usr/bin/env python3
"""The face detector of MediaPipe as ONNX, with dense weights.

    face_model.py face_detection_full_range_sparse.tflite blazeface_full_range.onnx

Reads the few operators that the network has, writes them, and checks that both networks answer alike. The network is in the Python package
`mediapipe` 0.10.14, folder modules/face_detection. Needs ai-edge-litert, tflite, onnx, onnxruntime and NumPy.
"""

import sys

import numpy as np
import onnx
import onnxruntime
import tflite
from ai_edge_litert.interpreter import Interpreter, OpResolverType
from onnx import TensorProto, helper, numpy_helper

KINDS = {number: name for name, number in vars(tflite.BuiltinOperator).items() if isinstance(number, int)}
# What both answer may differ by, of numbers up to some hundred in single precision.
ALIKE = 1e-3


class Network:
    """A TFLite network, and the ONNX one as far as it is written. Tensor 3 is called `t3`."""

    def __init__(self, path):
        self.model = tflite.Model.GetRootAsModel(open(path, "rb").read(), 0)
        self.graph = self.model.Subgraphs(0)
        resolver = OpResolverType.BUILTIN_WITHOUT_DEFAULT_DELEGATES
        self.interpreter = Interpreter(path, experimental_preserve_all_tensors=True, experimental_op_resolver_type=resolver)
        self.interpreter.allocate_tensors()
        self.input = self.interpreter.get_input_details()[0]
        self.answer(np.zeros(self.input["shape"], np.float32))
        self.dense, self.nodes, self.constants = {}, [], []

    def answer(self, picture):
        self.interpreter.set_tensor(self.input["index"], picture)
        self.interpreter.invoke()
        return [self.interpreter.get_tensor(t) for t in self.outputs()]

    def outputs(self):
        return [self.graph.Outputs(k) for k in range(self.graph.OutputsLength())]

    def shape(self, tensor):
        return [int(side) for side in self.graph.Tensors(tensor).ShapeAsNumpy()]

    def value(self, tensor):
        return self.dense[tensor] if tensor in self.dense else self.interpreter.get_tensor(tensor)

    def constant(self, name, value):
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def node(self, kind, inputs, output, **attributes):
        self.nodes.append(helper.make_node(kind, inputs, [output], **attributes))

    def activated(self, kind, inputs, output, activation, **attributes):
        """A node and what is applied to its output."""
        if activation == tflite.ActivationFunctionType.NONE:
            return self.node(kind, inputs, output, **attributes)
        assert activation == tflite.ActivationFunctionType.RELU
        self.node(kind, inputs, f"{output}_sum", **attributes)
        self.node("Relu", [f"{output}_sum"], output)

    def convert(self, number):
        operator = self.graph.Operators(number)
        code = self.model.OperatorCodes(operator.OpcodeIndex())
        kind = KINDS[max(code.BuiltinCode(), code.DeprecatedBuiltinCode())]
        inputs = [operator.Inputs(k) for k in range(operator.InputsLength())]
        output = operator.Outputs(0)
        first, out = f"t{inputs[0]}", f"t{output}"

        def options(table):
            found, raw = table(), operator.BuiltinOptions()
            found.Init(raw.Bytes, raw.Pos)
            return found

        if kind in ("DEQUANTIZE", "DENSIFY"):
            self.dense[output] = self.interpreter.get_tensor(output).astype(np.float32)
        elif kind == "PAD":
            # Pairs by axis of N H W C become beginnings and ends of N C H W.
            pads = self.value(inputs[1])[[0, 3, 1, 2]].T.reshape(-1)
            self.node("Pad", [first, self.constant(f"pads{number}", pads.astype(np.int64))], out)
        elif kind in ("CONV_2D", "DEPTHWISE_CONV_2D"):
            by_channel = kind == "DEPTHWISE_CONV_2D"
            said = options(tflite.DepthwiseConv2DOptions if by_channel else tflite.Conv2DOptions)
            weights = self.value(inputs[1]).transpose((3, 0, 1, 2) if by_channel else (0, 3, 1, 2))
            same = {"auto_pad": "SAME_UPPER"} if said.Padding() == tflite.Padding.SAME else {}
            names = [first, self.constant(f"weights{number}", weights), self.constant(f"bias{number}", self.value(inputs[2]))]
            places = {"strides": [said.StrideH(), said.StrideW()], "dilations": [1, 1], "kernel_shape": list(weights.shape[2:]), **same}
            group = weights.shape[0] if by_channel else 1
            self.activated("Conv", names, out, said.FusedActivationFunction(), group=group, **places)
        elif kind == "ADD":
            self.activated("Add", [f"t{t}" for t in inputs], out, options(tflite.AddOptions).FusedActivationFunction())
        elif kind == "RESIZE_BILINEAR":
            said = options(tflite.ResizeBilinearOptions)
            assert said.HalfPixelCenters() and not said.AlignCorners()
            before, after = self.shape(inputs[0]), self.shape(output)
            factors = np.array([1, 1, after[1] / before[1], after[2] / before[2]], np.float32)
            names = [first, "", self.constant(f"factors{number}", factors)]
            self.node("Resize", names, out, mode="linear", coordinate_transformation_mode="half_pixel")
        elif kind == "DEPTH_TO_SPACE":
            self.node("DepthToSpace", [first], out, blocksize=options(tflite.DepthToSpaceOptions).BlockSize(), mode="DCR")
        elif kind == "RESHAPE":
            self.node("Transpose", [first], f"{out}_last", perm=[0, 2, 3, 1])
            self.node("Reshape", [f"{out}_last", self.constant(f"shape{number}", np.array(self.shape(output), np.int64))], out)
        else:
            sys.exit(f"{kind} is not converted")

    def converted(self):
        for number in range(self.graph.OperatorsLength()):
            self.convert(number)
        first = self.graph.Inputs(0)
        _, height, width, channels = self.shape(first)
        taken = helper.make_tensor_value_info(f"t{first}", TensorProto.FLOAT, [1, channels, height, width])
        given = [helper.make_tensor_value_info(f"t{t}", TensorProto.FLOAT, self.shape(t)) for t in self.outputs()]
        graph = helper.make_graph(self.nodes, "faces", [taken], given, self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
        model.ir_version = 8
        onnx.checker.check_model(model)
        return model


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    network = Network(sys.argv[1])
    model = network.converted()
    onnx.save(model, sys.argv[2])
    session = onnxruntime.InferenceSession(sys.argv[2])
    random = np.random.default_rng(1)
    for _ in range(5):
        picture = random.uniform(-1, 1, network.input["shape"]).astype(np.float32)
        answers = session.run(None, {session.get_inputs()[0].name: picture.transpose(0, 3, 1, 2)})
        for expected, found in zip(network.answer(picture), answers, strict=True):
            apart = float(np.abs(expected - found).max())
            print(f"{found.shape}: up to {np.abs(expected).max():.0f}, apart by {apart:.1e}")
            if not apart <= ALIKE:
                sys.exit("the networks differ")


if __name__ == "__main__":
    main()
