"""Instructions, code and stack of exported C on Cortex processors, emulated by QEMU.

One step with its outputs, inputs held, on average over some steps; library functions are counted
too.  Instructions are no cycles: a Cortex-M7 may execute two in one, and waits for memory.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Literal, NamedTuple

import vehiclemor as vm

COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"
FLAGS = ("-std=gnu99", "-O2", "-mthumb", "-mfloat-abi=hard", "-ffunction-sections")


class Processor(NamedTuple):
    """A processor with its floating-point unit, the board that QEMU emulates, and a precision."""

    options: tuple[str, ...]
    board: str
    precision: Literal["double", "single"]


PROCESSORS = {
    "Cortex-M7 double": Processor(("-mcpu=cortex-m7", "-mfpu=fpv5-d16"), "mps2-an500", "double"),
    "Cortex-M7 single": Processor(("-mcpu=cortex-m7", "-mfpu=fpv5-d16"), "mps2-an500", "single"),
    "Cortex-M4F single": Processor(
        ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"), "mps2-an386", "single"
    ),
}
STEPS = 20
# Each instruction takes 2^6 ns of the emulated time, in which the timer ticks every 40 ns.
SHIFT, TICK = 6, 40
BOARD = ("-icount", f"shift={SHIFT}", "-display", "none", "-serial", "null", "-monitor", "none")
BOARD += ("-chardev", "stdio,id=out", "-semihosting-config", "enable=on,chardev=out")
LINKER = """
ENTRY(reset)
SECTIONS {
    . = 0;
    .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) }
    .ARM.exidx : { *(.ARM.exidx*) }
    .data : { *(.data*) }
    .bss : { *(.bss*) *(COMMON) }
    end = .;
}
"""
MAIN = """
#include <stdint.h>
#include <stdio.h>
#include "vehiclemor_model.h"

#define TOP ((uint32_t *)0x00400000)
#define PAINTED 16384
#define PAINT 0xa5a5a5a5u
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define NOW REGISTER(0xe000e018)

static vehiclemor_real x[VEHICLEMOR_STATES], y[VEHICLEMOR_OUTPUTS];
static vehiclemor_real u[VEHICLEMOR_INPUTS], c[VEHICLEMOR_CONSTANTS + 1];
static char text[99];

static void semihosting(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void failed(void)
{
    semihosting(0x18, (void *)0x20023);
}

static void __attribute__((noinline)) step(void)
{
    vehiclemor_step(x, u, u, c, VEHICLEMOR_STEP);
    vehiclemor_outputs(x, u, c, y);
}

static void measure(void)
{
    volatile uint32_t *place = TOP - PAINTED;
    uint32_t before, after, ticks = 0, *here = __builtin_frame_address(0);
    int i;
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        x[i] = vehiclemor_start[i];
    u[0] = (vehiclemor_real)STEERING;
    vehiclemor_constants(vehiclemor_parameters, c);
    while (place < here - 64)
        *place++ = PAINT;
    REGISTER(0xe000e014) = 0xffffff;
    REGISTER(0xe000e018) = 0;
    REGISTER(0xe000e010) = 5;
    for (i = 0; i < STEPS; i++) {
        before = NOW;
        after = NOW;
        ticks -= (before - after) & 0xffffff;
        before = NOW;
        step();
        after = NOW;
        ticks += (before - after) & 0xffffff;
    }
    place = TOP - PAINTED;
    while (*place == PAINT)
        place++;
    sprintf(text, "%lu %lu %ld\\n", (unsigned long)ticks,
            (unsigned long)((uint32_t)here - (uint32_t)place), (long)(1e6 * y[0]));
    semihosting(0x04, text);
    semihosting(0x18, (void *)0x20026);
}

static void reset(void)
{
    REGISTER(0xe000ed88) |= 0xf << 20; /* the floating-point unit */
    __asm__ volatile("dsb\\nisb");
    measure();
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    TOP, reset, failed, failed, failed, failed, failed};
"""


def missing() -> str:
    """What of the tools is not installed."""
    return ", ".join(tool for tool in (COMPILER, EMULATOR) if not shutil.which(tool))


def _said(*command: str, **options: Any) -> str:
    done = subprocess.run(  # noqa: S603  (compiler, its tools and the emulator)
        command, check=True, capture_output=True, text=True, **options
    )
    return done.stdout


def about() -> str:
    """Compiler and emulator."""
    first = (_said(tool, "--version").splitlines()[0] for tool in (COMPILER, EMULATOR))
    return f"{'; '.join(first)}; {FLAGS[1]}; {STEPS} steps"


def cost(model: Any, processor: Processor, steering: float, **options: Any) -> dict[str, int]:
    """Instructions of a step, bytes of code of model and step, bytes of stack; a position in um."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = vm.export(
            model, "c", Path(temporary) / "c", precision=processor.precision, **options
        )
        (folder / "main.c").write_text(MAIN)
        (folder / "board.ld").write_text(LINKER)
        flags = [*FLAGS, *processor.options, f"-DSTEPS={STEPS}", f"-DSTEERING={steering!r}"]
        names = "vehiclemor_model", "vehiclemor_step", "main"
        for name in names:
            _said(COMPILER, *flags, "-c", f"{name}.c", cwd=folder)
        objects = [f"{name}.o" for name in names]
        linked = "-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections", "-T", "board.ld"
        _said(COMPILER, *flags, *linked, *objects, "-lm", "-o", "program.elf", cwd=folder)
        sizes = _said(f"{COMPILER[:-3]}size", *objects[:2], cwd=folder).splitlines()[1:]
        board = *BOARD, "-M", processor.board, "-kernel", "program.elf"
        said = _said(EMULATOR, *board, cwd=folder, timeout=600)
    ticks, stack, position = map(int, said.split())
    code = sum(sum(map(int, line.split()[:2])) for line in sizes)
    count = round(ticks * TICK / 2**SHIFT / STEPS)
    return {"instructions": count, "code": code, "stack": stack, "position": position}
