"""Object code in memory: loaded with LLVM's own loader, without what has compiled it."""

from typing import Any

from vehiclemor.codegen.cache import once


class MachineCode:
    """Functions of an object file, at addresses in this process.

    Parameters
    ----------
    content
        The object file.
    """

    def __init__(self, content: bytes) -> None:
        import llvmlite.binding as llvm

        # The engine owns the memory in which the code lies, and its target machine.
        machine = _target().create_target_machine()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        """Address of a function."""
        found = self._engine.get_function_address(name)
        if not found:
            raise ImportError(f"the object code has no function {name}")
        return found


@once
def _target() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple())
