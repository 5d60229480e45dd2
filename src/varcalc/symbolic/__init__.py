"""CasADi expressions: traced from functions, read by their instructions, evaluated and differentiated at points."""
