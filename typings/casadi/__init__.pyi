# CasADi's own stub refuses calls that CasADi accepts (a buffer's set_arg, a Function of mixed SX and numbers), so for
# the type checker everything that comes from CasADi is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
