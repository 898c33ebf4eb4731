"""Structured Text of IEC 61131-3, run as a strict controller would: for tests only.

blark parses it. Its Earley parser takes 10 ms a line, so `read` builds the same tree of the part
of the language that is in use; what reads long blocks is held against blark on the short ones.
"""

import math
import re
from itertools import product
from types import SimpleNamespace

import blark.transform as tree
import numpy as np
from blark.parse import new_parser, parse_source_code

from pteron.export.structured_text import function_block
from pteron.kernels.graph import graph_of

_WORDS = """
    abs abstract acos action add and andn any array asin at atan atan2 begin bool by byte cal
    calc calcn case char concat configuration constant continue cos date date_and_time delete
    dint div do dt dword else elsif en end_action end_case end_class end_configuration end_for
    end_function end_function_block end_if end_interface end_method end_namespace end_program
    end_property end_repeat end_resource end_step end_struct end_transition end_type end_union
    end_var end_while eno eq exit exp expt extends f_edge false final find for from function
    function_block functionblock ge goto gt if implements initial_step insert int interface
    internal interval jmp ldate ldt le left len limit lint ln log lower_bound lreal lt ltime
    ltod lword max method mid min mod move mul mux namespace ne neg non_retain not null of on or
    orn overlap overload override persistent pointer priority private program property protected
    public r r1 r_edge read_only read_write real ref reference repeat replace resource ret
    retain return right rol ror s s1 sel shl shr sin single sint sizeof sqrt ss st step string
    struct sub super tan task then this time time_of_day to tod transition true trunc type udint
    uint ulint union until upper_bound using usint var var_access var_config var_external
    var_global var_in_out var_input var_inst var_output var_stat var_temp wchar while with word
    wstring xor
"""

_RESERVED = set(_WORDS.split())
"""Keywords, types and standard functions, which no variable may be called."""

_RULE = "function_block_type_declaration"
_parser = None


class Trap(ArithmeticError):
    """What stops a controller."""


def parse(text):
    """Return blark's tree of a function block."""
    global _parser
    if _parser is None:
        _parser = new_parser(start=[_RULE])
    result = parse_source_code(text, parser=_parser, starting_rule=_RULE)
    if result.exception is not None:
        raise result.exception
    (block,) = result.transform().items
    return block


class Block:
    """An instance of a function block: its variables keep their values between calls."""

    def __init__(self, block):
        self.name = str(block.name)
        self._body = block.body
        self._types, self._values, self._sections = {}, {}, {}
        for declarations in block.declarations:
            for item in declarations.items:
                for variable in item.variables:
                    self._declare(str(variable.name), declarations.block_header, item.init)

    def _declare(self, name, section, init):
        name = name.lower()
        assert name not in self._types, f"{name} is declared twice"
        assert name not in _RESERVED, f"{name} stands for something else in Structured Text"
        assert init.value is None
        kind = init.spec
        places = [()]
        if isinstance(kind, tree.ArraySpecification):
            ranges = [(int(r.start.value), int(r.stop.value)) for r in kind.subranges]
            places = list(product(*(range(first, last + 1) for first, last in ranges)))
            kind = kind.type.type_name
        else:
            kind = kind.type
        self._types[name] = str(kind).upper()
        self._sections[name] = section
        zero = {"LREAL": 0.0, "BOOL": False, "UDINT": 0}[self._types[name]]
        self._values[name] = dict.fromkeys(places, zero)

    def names(self, section):
        """Return the variables that "VAR", "VAR_INPUT" or "VAR_OUTPUT" declares."""
        return [name for name, of in self._sections.items() if of == section]

    def __call__(self, **inputs):
        """Run one cycle, and return the outputs: numbers, or dictionaries of them by subscripts.

        Temporary variables hold nothing at first: to read one before it is written is an error.
        """
        assert set(inputs) == set(self.names("VAR_INPUT"))
        for name, value in inputs.items():
            given = value if isinstance(value, dict) else {(): value}
            assert set(given) == set(self._values[name])
            self._values[name] = dict(given)
        for name in self.names("VAR"):
            self._values[name] = dict.fromkeys(self._values[name])
        self._run(self._body)
        return {
            name: dict(value) if () not in value else value[()]
            for name in self.names("VAR_OUTPUT")
            for value in [self._values[name]]
        }

    def _run(self, body):
        for statement in body.statements if body is not None else ():
            if isinstance(statement, tree.AssignmentStatement):
                self._assign(statement)
            elif isinstance(statement, tree.IfStatement):
                self._run(self._branch(statement))
            else:
                raise NotImplementedError(type(statement).__name__)

    def _branch(self, statement):
        for clause in (statement, *statement.else_ifs):
            if _truth(self.value(clause.if_expression)):
                return clause.statements
        return statement.else_clause.statements if statement.else_clause else None

    def _assign(self, statement):
        value = self.value(statement.expression)
        for variable in statement.variables:
            name, place = self._place(variable)
            assert self._sections[name] != "VAR_INPUT", f"{name} is an input"
            expected = {"LREAL": float, "BOOL": bool, "UDINT": int}[self._types[name]]
            assert type(value) is expected, f"{value!r} is no {self._types[name]}"
            self._values[name][place] = value

    def _place(self, variable):
        """Return the name and the subscripts of a variable, which must be there."""
        if isinstance(variable, tree.SimpleVariable):
            name, place = str(variable.name).lower(), ()
        else:
            assert isinstance(variable, tree.MultiElementVariable)
            (subscripts,) = variable.elements
            name = str(variable.name.name).lower()
            place = tuple(self.value(subscript) for subscript in subscripts.subscripts)
        assert place in self._values[name], f"{variable} is out of bounds"
        return name, place

    def value(self, expression):
        """Return the value of an expression."""
        match expression:
            case tree.SimpleVariable() | tree.MultiElementVariable():
                name, place = self._place(expression)
                value = self._values[name][place]
                assert value is not None, f"{name} is read before it is written"
                return value
            case tree.Real():
                return float(expression.value)
            case tree.Integer():
                return int(expression.value)
            case tree.Boolean():
                return expression.value.upper() == "TRUE"
            case tree.ParenthesizedExpression():
                return self.value(expression.expr)
            case tree.UnaryOperation():
                value = self.value(expression.expr)
                return {"NOT": lambda: not _truth(value), "-": lambda: -_real(value)}[
                    expression.op.upper()
                ]()
            case tree.BinaryOperation():
                left, right = self.value(expression.left), self.value(expression.right)
                return _binary(expression.op.upper(), left, right)
            case tree.FunctionCall():
                given = [self.value(parameter.value) for parameter in expression.parameters]
                return _call(str(expression.name).upper(), given)
        raise NotImplementedError(type(expression).__name__)


def _truth(value):
    assert type(value) is bool, f"{value!r} is no BOOL"
    return value


def _real(value):
    """Return an operand of arithmetic, which is a number on the controller."""
    assert type(value) is float, f"{value!r} is no LREAL"
    if not math.isfinite(value):
        raise Trap("arithmetic with what is not a number")
    return value


_COMPARISONS = {
    "=": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
}

_LOGIC = {"AND": lambda a, b: a and b, "OR": lambda a, b: a or b, "XOR": lambda a, b: a != b}


def _binary(operator, left, right):
    if operator in _LOGIC:
        return _LOGIC[operator](_truth(left), _truth(right))
    if operator in _COMPARISONS:
        assert type(left) is type(right) is float
        return _COMPARISONS[operator](left, right)
    a, b = _real(left), _real(right)
    if operator == "/" and b == 0.0:
        raise Trap("division by zero")
    # A lambda each, or the quotient would be formed whatever the operator.
    results = {"+": lambda: a + b, "-": lambda: a - b, "*": lambda: a * b, "/": lambda: a / b}
    value = results[operator]()
    if not math.isfinite(value):
        raise Trap("overflow")
    return value


def _call(name, given):
    if name == "ABS":
        (value,) = given
        assert type(value) is float
        return abs(value)
    numbers = [_real(value) for value in given]
    if name == "SQRT" and numbers[0] < 0.0:
        raise Trap("square root of a negative number")
    if name == "ATAN2" and numbers == [0.0, 0.0]:
        raise Trap("no angle")
    functions = {
        ("SQRT", 1): math.sqrt,
        ("SIN", 1): math.sin,
        ("COS", 1): math.cos,
        ("EXP", 1): math.exp,
        ("ATAN2", 2): math.atan2,
        ("MIN", 2): min,
        ("MAX", 2): max,
    }
    return functions[name, len(numbers)](*numbers)


_TOKEN = re.compile(
    r"""\s+ | \(\*.*?\*\) | (?P<real>\d+\.\d+(?:[eE][+-]?\d+)?) | (?P<integer>\d+)
    | (?P<name>[A-Za-z_]\w*) | (?P<sign>:=|\.\.|<=|>=|<>|[-+*/=<>()\[\],;:])""",
    re.VERBOSE | re.DOTALL,
)

_LEVELS = (("OR",), ("XOR",), ("AND",), ("=", "<>"), ("<=", ">=", "<", ">"), ("+", "-"), ("*", "/"))
"""Operators that bind ever closer; those of one level go from left to right."""


def read(text):
    """Return the tree that `parse` returns, for the part of the language that is in use."""
    reader = _Reader(text)
    block = reader.block()
    assert reader.token == ""
    return block


class _Reader:
    def __init__(self, text):
        self._tokens = []
        at = 0
        while at < len(text):
            found = _TOKEN.match(text, at)
            assert found, f"cannot read {text[at : at + 20]!r}"
            if found.lastgroup:
                self._tokens.append((found.lastgroup, found[0]))
            at = found.end()
        self._tokens.append(("end", ""))
        self._at = 0

    @property
    def kind(self):
        return self._tokens[self._at][0]

    @property
    def token(self):
        return self._tokens[self._at][1]

    def next(self):
        """Return the token, and go on."""
        self._at += 1
        return self._tokens[self._at - 1][1]

    def take(self, *texts):
        """Go on after the given tokens."""
        for text in texts:
            assert self.next().upper() == text, f"{text} expected"

    def word(self):
        assert self.kind == "name"
        return self.next()

    def block(self):
        self.take("FUNCTION_BLOCK")
        name, declarations = self.word(), []
        sections = {
            "VAR": tree.VariableDeclarations,
            "VAR_INPUT": tree.InputDeclarations,
            "VAR_OUTPUT": tree.OutputDeclarations,
        }
        while self.token in sections:
            section, items = sections[self.next()], []
            while self.token != "END_VAR":
                items.append(self.declaration())
            self.take("END_VAR")
            declarations.append(section(attrs=None, items=items))
        body = self.statements("END_FUNCTION_BLOCK")
        self.take("END_FUNCTION_BLOCK")
        return tree.FunctionBlock(name, None, None, None, declarations, body)

    def declaration(self):
        names = [self.word()]
        while self.token == ",":
            self.next()
            names.append(self.word())
        variables = [
            tree.DeclaredVariable(tree.SimpleVariable(name, False), None) for name in names
        ]
        self.take(":")
        if self.token != "ARRAY":
            spec = tree.TypeInitialization(tree.SimpleSpecification(self.word()), None)
            self.take(";")
            return tree.VariableOneInitDeclaration(variables, spec)
        self.next()
        ranges = []
        while self.token != "]":
            self.take("," if ranges else "[")
            first, _, last = self.primary(), self.take(".."), self.primary()
            ranges.append(tree.PartialSubrange(first, last))
        self.take("]", "OF")
        spec = tree.ArraySpecification(ranges, tree.DataType(None, self.word()))
        self.take(";")
        init = tree.ArrayTypeInitialization(None, spec, None)
        return tree.ArrayVariableInitDeclaration(variables, init)

    def statements(self, *ends):
        found = []
        while self.token not in ends:
            found.append(self.choice() if self.token == "IF" else self.assignment())
        return tree.StatementList(found) if found else None

    def choice(self):
        self.take("IF")
        ends = ("ELSIF", "ELSE", "END_IF")
        test, _, then = self.expression(), self.take("THEN"), self.statements(*ends)
        others, last = [], None
        while self.token == "ELSIF":
            self.next()
            clause = self.expression(), self.take("THEN"), self.statements(*ends)
            others.append(tree.ElseIfClause(clause[0], clause[2]))
        if self.token == "ELSE":
            self.next()
            last = tree.ElseClause(self.statements(*ends))
        self.take("END_IF", ";")
        return tree.IfStatement(test, then, others, last)

    def assignment(self):
        variable, _, value = self.primary(), self.take(":="), self.expression()
        self.take(";")
        return tree.AssignmentStatement([variable], value)

    def expression(self, level=0):
        if level == len(_LEVELS):
            return self.unary()
        value = self.expression(level + 1)
        while self.token.upper() in _LEVELS[level]:
            value = tree.BinaryOperation(value, self.next(), self.expression(level + 1))
        return value

    def unary(self):
        if self.token.upper() in ("-", "NOT"):
            return tree.UnaryOperation(self.next(), self.primary())
        return self.primary()

    def primary(self):
        kind, token = self.kind, self.next()
        if token == "(":
            value = self.expression()
            self.take(")")
            return tree.ParenthesizedExpression(value)
        if kind == "real":
            return tree.Real(token)
        if kind == "integer":
            return tree.Integer(token)
        assert kind == "name", f"{token!r} is no operand"
        if token.upper() in ("TRUE", "FALSE"):
            return tree.Boolean(token)
        name = tree.SimpleVariable(token, False)
        if self.token == "(":
            values = self._list("(", ")")
            return tree.FunctionCall(
                name, [tree.InputParameterAssignment(None, value) for value in values], False
            )
        if self.token == "[":
            subscripts = tree.SubscriptList(self._list("[", "]"), False)
            return tree.MultiElementVariable(name, False, [subscripts])
        return name

    def _list(self, first, last):
        values = []
        while self.token != last:
            self.take("," if values else first)
            values.append(self.expression())
        self.take(last)
        return values


def text_of(given, name="FB_Test", **more):
    graph = graph_of(given.function, given.inputs)
    return function_block(name, graph, given.inputs, given.outputs, **more)


def as_elements(port, values):
    """Return the elements of an array as the controller holds them, by subscripts."""
    values = np.asarray(values, dtype=float).ravel()
    if not port.shape:
        return float(values[0])
    places = product(*map(range, port.shape))
    return dict(zip(places, map(float, values), strict=True))


def as_array(port, elements):
    if not port.shape:
        return np.array([elements])
    return np.array([elements[place] for place in product(*map(range, port.shape))])


class Runner:
    """A program twice: as a block that runs, and in CasADi."""

    def __init__(self, given, **more):
        self.program = given
        self.text = text_of(given, **more)
        self.block = Block(read(self.text))

    def __call__(self, values):
        """Return Valid, Status and the outputs, one vector a port."""
        ports = self.program.inputs
        found = self.block(
            **{p.name: as_elements(p, v) for p, v in zip(ports, values, strict=True)}
        )
        outputs = [as_array(port, found[port.name]) for port in self.program.outputs]
        return SimpleNamespace(valid=found["valid"], status=found["status"], outputs=outputs)

    def casadi(self, values):
        results = self.program.function.call([np.asarray(value, float) for value in values])
        return [np.array(result).ravel("F") for result in results]
