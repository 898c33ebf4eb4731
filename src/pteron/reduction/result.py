"""`BaseParameters`, the result of `base_parameters`: names, sums, values and certificate."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from markupsafe import Markup

from pteron.arguments import expect_one_of
from pteron.bodies.parameters import Parameter
from pteron.errors import ModelError
from pteron.html_table import Column, Overview
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.manipulator import Manipulator, parameters as values_of
from pteron.reduction.certificate import Certificate, ExactCertificate
from pteron.reduction.exact_geometry import exact_geometry
from pteron.reduction.expressions import as_html, as_latex, as_sympy, as_text, terms_of
from pteron.reduction.grouping import Grouping, Shares
from pteron.reduction.latex_table import latex_table
from pteron.reduction.transfers import MassTransfer, transfers
from pteron.result import Result

if TYPE_CHECKING:
    import polars as pl

Form = Literal["text", "sympy", "latex", "html"]
"""Forms in which expressions are written."""

Symbols = bool | Literal["leg"]
"""Coefficients of expressions. False: numbers. True: symbols of the geometry, shared by legs that
are alike. "leg": symbols of each leg's own."""


@dataclass(frozen=True, eq=False, repr=False)
class BaseParameters(Result):
    """The parameters that alone act on the actuator forces, each a sum of inertial parameters.

    Attributes
    ----------
    robot : Manipulator
        The machine they belong to; its inertial parameters play no part.
    parameters : tuple of Parameter
        The columns, which they are sums of: `parameter_data`, or fewer where legs share theirs.
    kept : tuple of int
        Which columns are kept; the others join them.
    grouping : array, shape (rank, N)
        base = grouping @ parameters. Where legs share parameters it takes their mean.
    selection : array, shape (N, rank)
        base regressor = regressor @ selection.
    certificate : Certificate
        What proves, or supports, the rank.
    """

    robot: Manipulator
    parameters: tuple[Parameter, ...]
    kept: tuple[int, ...]
    grouping: Array = field(compare=False)
    selection: Array = field(compare=False)
    certificate: Certificate
    shares: Shares = field(compare=False)

    @classmethod
    def from_grouping(
        cls, robot: Manipulator, columns: tuple[Parameter, ...], sharing: Array, grouping: Grouping
    ) -> BaseParameters:
        """Return the base parameters of a grouping; `sharing` is (N, columns)."""
        mean = (sharing / sharing.sum(axis=0)).T
        return cls(
            robot=robot,
            parameters=columns,
            kept=grouping.kept,
            grouping=_matrix(grouping, len(columns)) @ mean,
            selection=sharing[:, list(grouping.kept)],
            certificate=grouping.certificate,
            shares={column: dict(terms) for column, terms in grouping.given.items()},
        )

    def __repr__(self) -> str:
        """Return a summary in a line; `expressions` and `values` have it all."""
        columns, method = len(self.columns), self.certificate.method
        return f"<BaseParameters of {self.robot.name!r}: {self.rank} of {columns}, {method}>"

    def _overview(self) -> Overview:
        """Return the overview table: base parameters, their values and units, and the proof."""
        columns = [Column("", "number"), Column("base parameter", "long")]
        columns += [Column("value", "number"), Column("unit")]
        sums, base_values = self.expressions("html"), self.values()
        rows = [
            (i, Markup(text), float(size), self.parameters[column].unit.replace("^2", "\u00b2"))
            for i, (text, size, column) in enumerate(
                zip(sums, base_values, self.kept, strict=True), start=1
            )
        ]
        about = f"{self.rank} base parameters of {len(self.columns)} inertial parameters"
        proof = self.certificate.summary().splitlines()[0]
        return Overview(self.robot.name, about, columns, rows, [proof])

    def summary(self) -> str:
        """Return the base parameters with their values and the certificate's summary, as text."""
        units = (self.parameters[column].unit for column in self.kept)
        rows = zip(self.expressions(), self.values(), units, strict=True)
        lines = [f"{text} = {number:.5g} {unit}" for text, number, unit in rows]
        return "\n".join([*lines, *self.certificate.summary().splitlines()])

    def table(self) -> pl.DataFrame:
        """Return a row for each base parameter: its name, sum, value and unit."""
        import polars as pl

        units = [self.parameters[column].unit for column in self.kept]
        columns = {"name": self.names, "expression": self.expressions(), "value": self.values()}
        return pl.DataFrame({**columns, "unit": units})

    @property
    def rank(self) -> int:
        """The number of base parameters."""
        return len(self.kept)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the base parameters: each is that of its independent column."""
        return tuple(self.columns[column] for column in self.kept)

    def values(self, robot: Manipulator | None = None) -> Array:
        """Return the base parameters' values (rank,) for a machine of this geometry."""
        return np.asarray(self.grouping @ values_of(robot or self.robot))

    @cached_property
    def transfers(self) -> tuple[MassTransfer, ...]:
        """The mass transfers, which give the groupings in symbols."""
        return tuple(transfers(self.robot, self.parameters))

    @cached_property
    def _symbol_values(self) -> dict[str, Any]:
        """The value of each geometric symbol, in symbols of which equal values share one."""
        from pteron.reduction.symbols import named_values  # SymPy

        return named_values(exact_geometry(self.robot))

    @cached_property
    def _symbolic(self) -> Shares:
        """The shares in symbols of the geometry; equal values share a symbol."""
        return self._symbolic_shares(self._symbol_values)

    @cached_property
    def _leg_shares(self) -> Shares:
        """The shares in symbols of the geometry, with separate symbols for each leg."""
        if not self.shared_symbols:
            return self._symbolic
        from pteron.reduction.symbols import named_values  # SymPy

        return self._symbolic_shares(named_values(exact_geometry(self.robot), shared=False))

    def _symbolic_shares(self, named: dict[str, Any]) -> Shares:
        """Return the shares with symbols; ModelError if the certificate is not exact."""
        if not isinstance(self.certificate, ExactCertificate):
            raise ModelError(
                f'symbols: not known to method "{self.certificate.method}"; use method="exact"'
            )
        unexplained = [self.columns.index(name) for name in self.certificate.unexplained]
        if unexplained and self.certificate.coefficients != "rational":
            raise ModelError(
                "symbols: this machine's special geometry groups "
                f"{', '.join(self.certificate.unexplained)} by numbers that are not rational; "
                "use symbols=False"
            )
        extra = [
            {column: Fraction(1), **{k: -share for k, share in self.shares[column].items()}}
            for column in unexplained
        ]
        from pteron.reduction.symbols import symbolic_shares  # SymPy

        return symbolic_shares(self.parameters, self.kept, self.transfers, extra, named)

    @property
    def geometry_values(self) -> dict[str, float]:
        """The geometric symbols of the expressions, and their values in metres."""
        lengths = self.leg_geometry_values.items()
        return {name: length for name, length in lengths if str(self._symbol_values[name]) == name}

    @property
    def leg_geometry_values(self) -> dict[str, float]:
        """The geometric symbols where each leg has its own, and their values in metres."""
        lengths = exact_geometry(self.robot).symbols().items()
        return {name: float(length) for name, length in lengths if length.q != 0}

    @property
    def shared_symbols(self) -> dict[str, tuple[str, ...]]:
        """The geometric symbols that stand for several values, equal but for their sign."""
        bearers: dict[str, tuple[str, ...]] = {}
        for name, symbol in self._symbol_values.items():
            bearer = str(symbol).lstrip("-")
            if bearer not in (name, "0"):
                bearers[bearer] = (*bearers.get(bearer, ()), name)
        return bearers

    def expressions(
        self, form: Form = "text", *, symbols: Symbols = False, digits: int = 4
    ) -> tuple[Any, ...]:
        """Return each base parameter as a sum of inertial parameters.

        Parameters
        ----------
        form : {"text", "sympy", "latex", "html"}
            Strings to read, SymPy expressions, LaTeX, or HTML.
        symbols : bool or "leg"
            Whether coefficients are written in symbols of the geometry (1/ll1^2, lu1/ll1^2, ...)
            instead of numbers. `geometry_values` says what they stand for; lengths that are equal
            share a symbol, which `shared_symbols` tells. With "leg" each leg has symbols of its
            own, of `leg_geometry_values`. Relations that no mass transfer explains stay numbers.
        digits : int
            Significant digits of numbers; SymPy keeps fractions exact.

        Returns
        -------
        tuple of str or of SymPy expression

        Raises
        ------
        ModelError
            If the form is not known, or symbols are not known to the method.
        """
        expect_one_of(get_args(Form), ModelError, form=form)
        if symbols not in (False, True, "leg"):
            raise ModelError(f'symbols: {symbols!r} is not True, False or "leg"')
        shares = (
            self._leg_shares if symbols == "leg" else self._symbolic if symbols else self.shares
        )
        sums = [terms_of(column, shares) for column in self.kept]
        if form == "sympy":
            return tuple(as_sympy(self.columns, terms) for terms in sums)
        write = {"text": as_text, "latex": as_latex, "html": as_html}[form]
        return tuple(write(self.parameters, terms, digits) for terms in sums)

    def to_latex(self, *, symbols: Symbols = False, digits: int = 4) -> str:
        r"""Return the base parameters and their values as a table in LaTeX.

        It takes the packages amsmath and booktabs; long sums go over several lines.

        Parameters
        ----------
        symbols, digits
            As for `expressions`; values have so many digits too.

        Returns
        -------
        str
            An environment `table` with a caption and a label.

        Raises
        ------
        ModelError
            As `expressions`.

        Examples
        --------
        >>> import pteron
        >>> table = pteron.base_parameters("five-bar").to_latex()
        >>> print(table.splitlines()[9])
            1 & $I_{u1} + I_{l1}$ & $0.0002835$ & $\mathrm{kg\,m^2}$ \\
        """
        sums, printed = (
            self.expressions(form, symbols=symbols, digits=digits) for form in ("latex", "text")
        )
        units = [self.parameters[column].unit for column in self.kept]
        return latex_table(self.robot.name, sums, printed, self.values().tolist(), units, digits)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data, fractions as text."""
        return {
            "robot": self.robot.name,
            **json_fields(rank=self.rank, names=self.names, columns=self.columns),
            "expressions": list(self.expressions(digits=12)),
            "grouping": self.grouping.tolist(),
            "shares": {
                self.columns[j]: {self.columns[k]: str(share) for k, share in shares.items()}
                for j, shares in self.shares.items()
            },
            "values": self.values().tolist(),
            "certificate": self.certificate.as_dict(),
        }

    def to_json(self) -> str:
        """Return `as_dict` as JSON."""
        return json.dumps(self.as_dict(), indent=2)


def _matrix(grouping: Grouping, columns: int) -> Array:
    """Return the matrix (rank, columns) that takes column parameters to base parameters."""
    matrix = np.zeros((len(grouping.kept), columns))
    matrix[range(len(matrix)), list(grouping.kept)] = 1.0
    place = {column: row for row, column in enumerate(grouping.kept)}
    for column, shares in grouping.given.items():
        for k, share in shares.items():
            matrix[place[k], column] = float(share)
    return matrix
