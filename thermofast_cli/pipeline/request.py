"""What is asked of runs: of their sensors, and of what is known of their machine beforehand."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from thermofast.filters import Afukf
from thermofast.models.standards import Criterion

from ..errors import UsageError
from ..estimation.request import Method, Question
from ..standards.stopping import Rule

if TYPE_CHECKING:
    from ..machine.model import Model


@dataclass(frozen=True)
class Request:
    """What ``identify`` is asked: steady state and settling time of every sensor, and what there is beside these.

    until_min: from which first minutes, None for all; at_min [min after the start]: a temperature then; room_c [degC]: the steady
    state in that room; criterion: a stopping rule, when it holds; limit_c [degC]: a limit, how far the steady state is below it;
    switch_off_min [min after the first reading, negative before it]: when the machine was switched off, for the temperature then.

    model: what past runs taught; drive: a logged column that the heat follows; auto: what the readings used show to be missing is
    looked for and added first. joint: one adaptive fading filter over all sensors of a run; details: with curves and traces.
    """

    until_min: float | None = None
    at_min: float | None = None
    room_c: float | None = None
    criterion: Criterion | None = None
    limit_c: float | None = None
    switch_off_min: float | None = None
    model: "Model | None" = None
    drive: str | None = None
    auto: bool = False
    joint: bool = False
    details: bool = False

    @property
    def of_machine(self) -> bool:
        """Whether something is known of the machine, or looked for, beyond a sensor's readings."""
        return self.model is not None or self.drive is not None or self.auto

    def question(self, rule: Rule | None) -> Question:
        """What is asked of each sensor of a run for which the stopping rule is this one."""
        return Question(self.until_min, self.at_min, self.room_c, rule, self.joint, self.details)

    def without_search(self) -> "Request":
        """The same without what ``auto`` may add, asked of the readings alone."""
        return replace(self, auto=False, limit_c=None, switch_off_min=None)

    def check(self, method: Method) -> None:
        """Raises UsageError where settings exclude each other, or a `method` cannot answer."""
        if self.joint and type(method.filter) is not Afukf:
            found = "--preset paper" if method.filter.name == Afukf.name else f"--filter {method.filter.name}"
            raise UsageError("--joint runs the AFUKF over all sensors", found=found, do="leave one of them out")
        if self.model is not None and self.auto:
            raise UsageError(
                "--auto looks for effects beside the base model, and --model tells them",
                do="leave one of them out; thermofast improve --auto learns a model with what is found",
            )
        check_closes(method, self.of_machine)
        if self.criterion is not None and not method.widens:
            raise UsageError(
                "--criterion is foretold by the closing estimate that counts the machine, which is not made here",
                **_not_made(method),
            )
        if self.criterion is not None and method.paces:
            raise UsageError(
                "--criterion is foretold at the rate of the readings, which --pace changes", do="leave one of them out"
            )


def check_closes(method: Method, of_machine: bool) -> None:
    """Raises UsageError where what is known of the machine would be left out without a word."""
    if of_machine and not method.widens:
        raise UsageError(
            "--model, --drive and --auto enter the closing estimate that counts the machine, which is not made here",
            **_not_made(method),
        )


def _not_made(method: Method) -> dict[str, str]:
    """The option for which there is no closing estimate that counts the machine, and what to do."""
    if method.filter.closing != "never":
        return {"found": "--imperfection none --rates own", "do": "leave one of them out"}
    if method.filter.name == Afukf.name:
        return {"found": "--preset paper", "do": "leave it out"}
    return {"found": f"--filter {method.filter.name}", "do": "use --filter afukf"}
