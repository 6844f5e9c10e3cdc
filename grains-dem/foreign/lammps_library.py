"""LAMMPS's library through ctypes: commands, the atoms' and the fixes' arrays, a force from outside at every step."""
import ctypes, ctypes.util
from estuary_participant import Refused

INTEGERS, DOUBLES = ctypes.POINTER(ctypes.c_int), ctypes.POINTER(ctypes.c_double)
ROWS = ctypes.POINTER(DOUBLES)
CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int, INTEGERS, ROWS, ROWS)
PER_ATOM, ARRAY = 1, 2


def installed():
    return ctypes.util.find_library("lammps") is not None


class Lammps:
    def __init__(self):
        self.library = ctypes.CDLL(ctypes.util.find_library("lammps"))
        for function in ("lammps_open_no_mpi", "lammps_extract_atom", "lammps_extract_fix", "lammps_extract_global"):
            getattr(self.library, function).restype = ctypes.c_void_p
        words = [b"lammps", b"-log", b"none", b"-screen", b"none"]
        self.handle = ctypes.c_void_p(self.library.lammps_open_no_mpi(len(words), (ctypes.c_char_p * len(words))(*words), None))

    def command(self, *lines):
        for line in lines:
            self.library.lammps_command(self.handle, line.encode())
            if self.library.lammps_has_error(self.handle):
                text = ctypes.create_string_buffer(1000)
                self.library.lammps_get_last_error_message(self.handle, text, 1000)
                raise Refused(f"LAMMPS: {text.value.decode().strip()} (at '{line}')", "DIVERGED",
                              advice="grains that overlap or move too fast: a shorter window, or a smaller normal_stiffness")

    def atoms(self, name, kind=ROWS):
        return ctypes.cast(self.library.lammps_extract_atom(self.handle, name), kind)

    def rows_of_fix(self, name):
        return ctypes.cast(self.library.lammps_extract_fix(self.handle, name.encode(), PER_ATOM, ARRAY, 0, 0), ROWS)

    def step(self):
        return ctypes.cast(self.library.lammps_extract_global(self.handle, b"ntimestep"), ctypes.POINTER(ctypes.c_int64))[0]

    def at_every_step(self, fix, function):
        """`function(step, count, identities, forces)` by the fix, which is of style external in mode pf/callback."""
        self.keep = CALLBACK(lambda _, step, count, identity, position, force: function(step, count, identity, force))
        self.library.lammps_set_fix_external_callback(self.handle, fix.encode(), self.keep, None)
