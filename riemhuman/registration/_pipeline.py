"""The stages of a registration in order: search, dense fit, arms and hands, elastic step, trust.

A doubtful result is searched again: from other starts, without a floor, and as half a body.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from riemhuman.registration._arms_and_hands import BodyFit, fit_arms_and_hands
from riemhuman.registration._dense_fit import fit_densely
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._start_search import (
    KnownBody,
    Search,
    find_likelihood_of_area,
    search_scan,
    with_likeliest_arms,
)
from riemhuman.registration._verdict import judge
from riemhuman.registration.registration_traces import RegistrationTrace


@dataclass(frozen=True, eq=False)
class ModelAndHalves:
    """A model, and the same without legs and without all above the waist, if it has these."""

    whole: RegistrationModel
    halves: list[RegistrationModel]


@dataclass(frozen=True, eq=False)
class ScanTask:
    """A scan with the models that are fitted to it, and what was found for half bodies."""

    models: ModelAndHalves
    scan: PreparedScan
    up_is_known: bool
    unit_is_known: bool
    found_halves: dict[int, RegistrationTrace] = field(default_factory=dict)

    def half(self, number: int) -> RegistrationTrace:
        """Return the registration of half a body; computed once."""
        if number not in self.found_halves:
            search = search_scan(self.models.halves[number], self.scan)
            self.found_halves[number] = fit_and_judge(search, unit_is_known=self.unit_is_known)
        return self.found_halves[number]


def register_scan(task: ScanTask, known: KnownBody | None = None) -> RegistrationTrace:
    """Return the likeliest of the registrations of a whole and of half a body."""
    first = register_whole(task, known)
    if first.verdict.trusted:
        return first
    other = _register_again(task, first, again=known is None)
    gain = task.models.whole.settings.retries.retry_gain
    likelier = other.verdict.likelihood > first.verdict.likelihood + gain
    return other if other.verdict.trusted or likelier else first


def register_whole(task: ScanTask, known: KnownBody | None = None) -> RegistrationTrace:
    """Return the registration of one search, or that of half a body if the scan shows no more."""
    search = search_scan(task.models.whole, task.scan, known)
    return _or_half(task, fit_and_judge(search, unit_is_known=task.unit_is_known))


def fit_and_judge(search: Search, *, unit_is_known: bool = True) -> RegistrationTrace:
    """Return the stages after a search."""
    best = search.candidates[0]
    dense = fit_densely(search.body, best, search.scan)
    arms = fit_arms_and_hands(dense, known=best.known)
    elastic = leave_model(arms.task, arms.pose)
    fitted = BodyFit(arms.task, elastic, arms.doubtful_arms, arms.hand_fits)
    verdict = judge(search, fitted, unit_is_known=unit_is_known)
    return RegistrationTrace(search, dense, arms, elastic, verdict)


def _or_half(task: ScanTask, trace: RegistrationTrace) -> RegistrationTrace:
    """Return a registration, or that of half a body if the scan shows no more."""
    # The model has no way to leave out legs: without points of their own, they are fitted to the
    # trunk and pull it out of place. Few of their vertices match then, and a body without legs
    # comes near to all of the scan.
    whole, verdict = task.models.whole, trace.verdict
    halves = whole.parts.halves if verdict.trusted_vertices.any() else []
    for number, missing in enumerate(halves):
        few = verdict.matched[missing].mean() < whole.settings.retries.least_matched_half
        if few and _near_share(task.half(number)) >= whole.settings.trust.least_near:
            return task.half(number)
    return trace


def _near_share(trace: RegistrationTrace) -> float:
    """Return the share of a scan, without its background, that is near the body."""
    verdict, settings = trace.verdict, trace.search.body.settings.trust
    return float(np.mean(verdict.distances[~verdict.background] < settings.near_metres))


def _register_again(task: ScanTask, first: RegistrationTrace, *, again: bool) -> RegistrationTrace:
    """Return the registration from other starts, without a direction up from a floor, or of a half.

    Only the likeliest of these searches is followed to its end.
    """
    whole, scan = task.models.whole, task.scan
    searches = [search_scan(whole, scan, again=again)]
    if scan.floor is not None and not task.up_is_known:
        without_floor = replace(scan, up=None, floor=None, other_ups=())
        searches.append(search_scan(whole, without_floor, quick=True))
    near_enough = whole.settings.retries.near_of_half
    if not first.verdict.trusted_vertices.any() and _near_share(first) > near_enough:
        searches += [search_scan(half, scan, quick=True) for half in task.models.halves]
    likeliest = max(searches, key=_likelihood_of)
    if likeliest is not searches[0]:
        likeliest = with_likeliest_arms(likeliest)
    other = fit_and_judge(likeliest, unit_is_known=task.unit_is_known)
    return _or_half(task, other) if likeliest.body is whole else other


def _likelihood_of(search: Search) -> float:
    """Return the log-likelihood of a search's best body, of what the scan can show of it."""
    body, best = search.body, search.candidates[0]
    visible = body.find_visible(body.surface(best.pose), search.scan.points, best.up)
    return find_likelihood_of_area(body, best.pose, search.scan, best.up, visible)
