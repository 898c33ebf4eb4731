"""NVIDIA's run-time compiler, from its wheel, which needs no GPU: `compiled` returns a report."""

import ctypes
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple


class Report(NamedTuple):
    """What the assembler says of a kernel."""

    registers: int
    spilled: int
    """Bytes that a thread stores in memory for lack of registers."""
    stack: int
    size: int
    """Bytes of the machine code."""


@cache
def library():
    """Return the library, or None where the wheel is not installed."""
    try:
        spec = find_spec("nvidia.cuda_nvrtc")
    except ModuleNotFoundError:
        return None
    places = spec.submodule_search_locations if spec else ()
    paths = [path for place in places for path in Path(place, "lib").glob("libnvrtc.so.*")]
    paths = [path for path in paths if "alt" not in path.name]
    return ctypes.CDLL(str(paths[0])) if paths else None


def compiled(source, architecture="sm_90", options=("--fmad=false",)):
    """Return the worst of the reports on a source's kernels; AssertionError with the log."""
    nvrtc, program = library(), ctypes.c_void_p()
    texts = (source.encode(), b"kernel.cu")
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), *texts, 0, None, None)
    words = ["-std=c++17", f"--gpu-architecture={architecture}", "--ptxas-options=-v", *options]
    array = (ctypes.c_char_p * len(words))(*(word.encode() for word in words))
    failed = nvrtc.nvrtcCompileProgram(program, len(words), array)
    log = _text(nvrtc.nvrtcGetProgramLogSize, nvrtc.nvrtcGetProgramLog, program)
    assert not failed, log
    size = ctypes.c_size_t()
    nvrtc.nvrtcGetCUBINSize(program, ctypes.byref(size))
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    registers = re.findall(r"Used (\d+) registers", log)
    spilled = re.findall(r"(\d+) bytes stack frame, (\d+) bytes spill stores", log)
    assert registers, log
    stack, stores = (max(map(int, column)) for column in zip(*spilled, strict=True))
    return Report(max(map(int, registers)), stores, stack, size.value)


def _text(size_of, text_of, program):
    """Return a text of a program."""
    size = ctypes.c_size_t()
    size_of(program, ctypes.byref(size))
    text = ctypes.create_string_buffer(size.value)
    text_of(program, text)
    return text.value.decode()
