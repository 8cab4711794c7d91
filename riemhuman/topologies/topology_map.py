"""Bodies of one topology as bodies of another, by a map that is made once."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, overload

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, ArrayLike, Integers, Triangles, Values
from riemhuman.bodies import BodyModel, ModelFit
from riemhuman.checks import (
    check_same_scale,
    checked,
    checked_rate,
    choice,
    flag,
    index_array,
    instance,
    longest_side,
    real_array,
)
from riemhuman.checks.labels import text
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.files import file_path, format_errors
from riemhuman.io.mesh_arrays import check_mesh, face_difference
from riemhuman.io.meshes import as_arrays, load_mesh, load_split_mesh
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.mocap.motion_arrays import one_person, warn_of_varying_betas
from riemhuman.mocap.motions import ArrayMotion
from riemhuman.mocap.photographed_bodies import refuse_mirrored, standing_axis, turn_upright
from riemhuman.registration import RegisteredScan, ScanRegistration
from riemhuman.surfaces.measures import split_triangles, triangle_areas
from riemhuman.surfaces.nearest_points import SurfacePoints
from riemhuman.surfaces.procrustes import AXES, make_upright
from riemhuman.topologies._mirrored_meshes import symmetric_surface
from riemhuman.topologies._topology_weights import (
    combined_vertices,
    example_people,
    learned_weights,
)
from riemhuman.topologies._vertex_places import (
    FilledPart,
    VertexPlaces,
    filled_parts,
    find_without_counterpart,
    joined_components,
    place_vertices,
)

# Meshes are refined to this many vertices, because registration samples vertices.
_FEWEST_VERTICES = 5000
# Parts with a smaller share of the area are left out of registration: eyeballs, teeth.
_SMALL_PART = 0.01
# A registered surface slides along itself by less, metres.
_LONGEST_SLIDE = 0.02
# Cosine between the directions up and away from the feet, below which bodies are upside down.
_UPSIDE_DOWN = -0.5
_SHARE_OF_FEET = 0.03  # of the vertices

_ARRAYS = (
    "template",
    "template_faces",
    "registered",
    "model_faces",
    "to_model_triangles",
    "to_model_barycentric",
    "to_model_heights",
    "to_template_triangles",
    "to_template_barycentric",
    "to_template_heights",
    "template_part_names",
    "template_part_numbers",
    "model_part_names",
    "model_part_numbers",
    "message",
)
# For one direction only, and absent from older files.
_LEARNED = ("to_model_columns", "to_model_weights", "to_template_columns", "to_template_weights")


@dataclass(frozen=True, eq=False)
class TopologyMap:
    """A map between the bodies of a body model and those of another topology.

    Every vertex of each mesh has a place on the other: a triangle, barycentric coordinates, and a
    height along the interpolated normal, which rotates and scales with the triangles around it.
    From a coarser mesh, whose flat triangles miss the body, each vertex is a weighted mean of the
    vertices around its place, with weights learned from simulated people of the model. A map is
    computed once, by registration of a body of the other topology, and then takes milliseconds per
    body. On simulated people with another mesh, the mean error for other people in other poses is
    at most 3 mm, and for mapping there and back, even through the coarse model, at most 1 mm
    (tests/topologies/test_topology_map.py asserts it).

    Use it to convert existing bodies. To generate and pose new bodies, use `transfer_model`, which
    creates a body model of the other topology, with skinning weights and shape directions.

    If the triangulations of both meshes are symmetric, mapping a mirrored body gives the mirrored
    result to 0.05 mm on average. The full open model is symmetric in this sense, the coarse model
    is not.

    Parts without counterpart, such as eyeballs, teeth or the inside of a mouth, move with their
    surroundings.

    Attributes
    ----------
    model : BodyModel
    template_faces : array of int, shape (F, 3)
        Triangles of the other topology.
    message : str
        Doubts that the registration left.
    model_places : VertexPlaces
        For the model's vertices, `places` on the other topology (triangles and barycentric
        coordinates) and `heights` above them, metres.
    template_places : VertexPlaces
        For the vertices of the other topology, the same on the model.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> body = bodies[0], bodies.template.faces
    >>> topology = rh.topologies.TopologyMap.fit(body, bodies.model)  # doctest: +SKIP
    >>> topology.to_model(bodies[:3]).shape  # doctest: +SKIP
    (3, 1202, 3)
    """

    model: BodyModel
    template_faces: Triangles
    message: str
    model_places: VertexPlaces
    template_places: VertexPlaces

    @classmethod
    @checked(model=instance(BodyModel), up=choice(*AXES))
    def fit(
        cls,
        template: object,
        model: BodyModel | None = None,
        *,
        faces: ArrayLike | None = None,
        up: str | None = None,
    ) -> TopologyMap:
        """Compute a map from bodies of the other topology.

        Parameters
        ----------
        template : path, Template, mesh, array_like or pair
            A body of the other topology in any pose and any axes, metres: a file, a mesh, or
            vertices and triangles.
        model : BodyModel, optional
            By default the open model at full resolution.
        faces : array_like of int, shape (F, 3), optional
            Triangles, if `template` is an array of vertices only.
        up : {"x", "y", "z", "-x", "-y", "-z"}, optional
            Axis that points up in the body, which is turned upright. By default it is found from
            its feet or, if that is ambiguous, by registration.

        Raises
        ------
        ArgumentError
            If triangles face inward, as those of a mirrored body do; if the body is not in metres;
            or if its registration is not trusted.
        FileFormatError
            The same for a file.
        """
        model = load_open_model() if model is None else model
        body, triangles = _body_and_faces(template, faces)
        name = "template"
        error: type[Exception] = ArgumentError
        if isinstance(template, (str, os.PathLike)):
            name, error = os.fspath(template), FileFormatError
        _check_bodies(body, triangles, name, model.template.vertices, error)
        body = turn_upright(body, up=up or standing_axis(body, triangles))
        reference = _rounded(body)
        dense, kept = _dense_model(model)
        with single_threaded_libraries():
            result = _register(body, triangles, dense)
            if not result.trusted:
                raise error(
                    f"{name} must be a body to which the model can be registered; found that "
                    f"{result.message}"
                )
            message = result.message
            registered = _rounded(_smoothed_surface(result, dense))
            registered = _rounded(symmetric_surface(reference, triangles, registered, dense))
            fine = cls._from_surfaces(dense, reference, triangles, registered, message)
            if dense is model:
                return fine._with_learned_weights(fine, kept)
            unlearned = cls._from_surfaces(model, reference, triangles, registered[kept], message)
            return unlearned._with_learned_weights(fine, kept)

    @classmethod
    def _from_surfaces(
        cls,
        model: BodyModel,
        reference: Array,
        triangles: Triangles,
        registered: Array,
        message: str,
    ) -> TopologyMap:
        """Return the map of two surfaces that coincide."""
        everywhere = np.ones(len(registered), dtype=bool)
        *_, gaps = place_vertices(reference, triangles, registered, model.faces, everywhere)
        template_lacks = find_without_counterpart(reference, triangles, gaps)
        on_template, heights_of_model, gaps = place_vertices(
            registered, model.faces, reference, triangles, ~template_lacks
        )
        model_lacks = find_without_counterpart(registered, model.faces, gaps)
        on_model, heights_of_template, _ = place_vertices(
            reference, triangles, registered, model.faces, ~model_lacks
        )
        owners = model.weights.argmax(axis=1)
        left = model.template.vertices[:, 0] - np.median(model.template.vertices[:, 0])
        near = model.faces[on_model.triangles, on_model.barycentric.argmax(axis=1)]
        template_parts = filled_parts(
            reference, triangles, template_lacks, owners[near], model.joint_names, left[near]
        )
        model_parts = filled_parts(
            registered, model.faces, model_lacks, owners, model.joint_names, left
        )
        return cls(
            model,
            triangles,
            message,
            _vertex_places(
                (on_template, heights_of_model),
                reference,
                triangles,
                registered,
                model.faces,
                model_parts,
            ),
            _vertex_places(
                (on_model, heights_of_template),
                registered,
                model.faces,
                reference,
                triangles,
                template_parts,
            ),
        )

    def _with_learned_weights(self, fine: TopologyMap, kept: Integers) -> TopologyMap:
        """Return the map with weights that are learned from people of the model.

        Their bodies are known. On the template, they are where the places of a dense model put
        them, which needs no weights.

        `fine` is the map of the dense model, of whose vertices the model has those in `kept`.
        """
        people = example_people(fine.model)
        templates = np.stack([fine.template_places.apply(body) for body in people])
        bodies = people[:, kept]
        to_model = _learned(self.model_places, self.template_places.parts, [templates], bodies)
        if self.model.n_vertices >= self.n_template_vertices:
            return replace(self, model_places=to_model)
        # Also from what the template contributes, so that bodies return to where they were.
        returned = np.stack([to_model.apply(body) for body in templates])
        lacking = self.model_places.parts
        to_template = _learned(self.template_places, lacking, [bodies, returned], templates)
        return replace(self, model_places=to_model, template_places=to_template)

    @property
    def n_template_vertices(self) -> int:
        """Number of vertices of the other topology."""
        return self.model_places.n_source

    @property
    def template_parts(self) -> dict[str, Integers]:
        """Vertices of the other topology without counterpart on the model, by part."""
        return {part.name: part.vertices for part in self.template_places.parts}

    @property
    def model_parts(self) -> dict[str, Integers]:
        """Vertices of the model without counterpart on the other topology, by part."""
        return {part.name: part.vertices for part in self.model_places.parts}

    def __repr__(self) -> str:
        names = [*self.template_parts]
        lacking = f", without counterpart: {', '.join(names[:4])}" if names else ""
        return (
            f"<TopologyMap: {self.n_template_vertices:,} to {self.model.n_vertices:,} "
            f"vertices{lacking}>"
        )

    @overload
    def to_model(
        self, points: object, *, fit: Literal[False] = False, up: str | None = None
    ) -> Array: ...

    @overload
    def to_model(
        self, points: object, *, fit: Literal[True], up: str | None = None
    ) -> tuple[Array, ModelFit]: ...

    @checked(fit=flag, up=choice(*AXES))
    def to_model(
        self, points: object, *, fit: bool = False, up: str | None = None
    ) -> Array | tuple[Array, ModelFit]:
        """Return bodies of the other topology as bodies of the model.

        Parameters
        ----------
        points : array_like, shape (..., V, 3), path, mesh or pair
            Bodies of the other topology, metres, y up; or a mesh, whose triangles are compared.
        fit : bool
            Whether to return betas, poses and translations, too. An array with one leading axis is
            treated as a sequence, in which each fit starts from the previous one.
        up : {"x", "y", "z", "-x", "-y", "-z"}, optional
            Axis that points up, rotated to y. By default bodies stay as they are, and an error
            says if most are upside down.

        Returns
        -------
        array, shape (..., model.n_vertices, 3), or a pair of it and a ModelFit
        """
        mapped = _applied(self.model_places, _checked(points, self.model_places, up))
        if not fit:
            return mapped
        return mapped, self.model.fit(mapped, betas_prior=1e-7, sequence=mapped.ndim == 3)

    @checked(frames_per_second=checked_rate, name=text, up=choice(*AXES))
    def to_motion(
        self, points: object, frames_per_second: float, *, name: str = "", up: str | None = None
    ) -> ArrayMotion:
        """Return bodies of the other topology, the frames of one person's motion, as a motion.

        The model is fitted to every frame, starting from the previous one. The person has the mean
        of the betas, and a warning says by how much they differ. `Motion.save` writes the result in
        AMASS's layout, as BVH or as GLB.

        Parameters
        ----------
        points : array_like, shape (n_frames, V, 3)
            Bodies of the other topology, metres, y up.
        frames_per_second : float
        name : str
            Name of the motion.
        up : {"x", "y", "z", "-x", "-y", "-z"}, optional
            As for `to_model`.

        Raises
        ------
        ArgumentError
            If there is no frame, or bodies are refused as by `to_model`.
        """
        mapped = self.to_model(points, up=up)
        if mapped.ndim != 3 or not len(mapped):
            raise ArgumentError(
                "points must have shape (n_frames, V, 3), with at least one frame; found frames of "
                f"shape {mapped.shape[:-2]}"
            )
        fit = self.model.fit(mapped, betas_prior=1e-7, sequence=True)
        person, spread = one_person(fit.betas, len(mapped))
        warn_of_varying_betas(spread, name)
        return ArrayMotion(("", name), frames_per_second, self.model, person, fit.pose, fit.trans)

    @checked(up=choice(*AXES))
    def to_template(self, points: object, *, up: str | None = None) -> Array:
        """Return bodies of the model as bodies of the other topology.

        Parameters
        ----------
        points : array_like, shape (..., model.n_vertices, 3), path, mesh or pair
            Bodies of the model, metres, y up.
        up : {"x", "y", "z", "-x", "-y", "-z"}, optional
            As for `to_model`.

        Returns
        -------
        array, shape (..., V, 3)
        """
        return _applied(self.template_places, _checked(points, self.template_places, up))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map as a compressed .npz file.

        Parameters
        ----------
        path : path_like
            File to write, with its suffix; an existing file is replaced.
        """
        save_arrays(
            path,
            {
                "template": self.model_places.source.astype(np.float32),
                "template_faces": self.template_faces.astype(np.int32),
                "registered": self.template_places.source.astype(np.float32),
                "model_faces": self.model.faces.astype(np.int32),
                **_stored_places("to_model", self.model_places),
                **_stored_places("to_template", self.template_places),
                **_stored_parts("template", self.template_places.parts),
                **_stored_parts("model", self.model_places.parts),
                "message": np.array(self.message),
            },
            compressed=True,
        )

    @classmethod
    @checked(model=instance(BodyModel))
    def load(cls, path: str | os.PathLike[str], model: BodyModel | None = None) -> TopologyMap:
        """Read a map that `save` wrote.

        Parameters
        ----------
        path : path_like
        model : BodyModel, optional
            The model of the map; by default the open model with its number of vertices.

        Raises
        ------
        FileFormatError
            If the file holds no map, or the map of another model.
        """
        arrays = load_arrays(path, _ARRAYS, optional=_LEARNED)
        file = file_path(path)
        with format_errors(file, "a topology map"):
            template, registered = (
                np.asarray(real_array(arrays[name], name, ("n", 3), batched=False), dtype=float)
                for name in ("template", "registered")
            )
            template, faces = check_mesh(template, arrays["template_faces"])
            registered, model_faces = check_mesh(registered, arrays["model_faces"])
            chosen = _model_with(model, model_faces, len(registered))
            to_model = _read_places("to_model", arrays, len(registered), len(faces))
            to_template = _read_places("to_template", arrays, len(template), len(model_faces))
            model_parts = _read_parts("model", arrays, len(registered))
            template_parts = _read_parts("template", arrays, len(template))
            model_places = _with_read_weights(
                "to_model",
                arrays,
                _vertex_places(to_model, template, faces, registered, model_faces, model_parts),
            )
            template_places = _with_read_weights(
                "to_template",
                arrays,
                _vertex_places(
                    to_template, registered, model_faces, template, faces, template_parts
                ),
            )
        return cls(chosen, faces, str(arrays["message"]), model_places, template_places)


def _checked(points: object, places: VertexPlaces, up: str | None = None) -> Array:
    """Return surfaces of the source of a map, y up."""
    name = "points"
    error: type[Exception] = ArgumentError
    if isinstance(points, (str, os.PathLike)):
        name, error = os.fspath(points), FileFormatError
        points = load_split_mesh(points, places.faces)
    is_pair = isinstance(points, tuple) and len(points) == 2
    if is_pair or hasattr(points, "faces") or hasattr(points, "cells"):
        points, faces = as_arrays(points)
        difference = face_difference(faces, places.faces)
        if len(points) == places.n_source and difference:
            raise error(f"{name} must have the triangles of the map: {difference}")
    surfaces = real_array(points, name, ("n_vertices", 3))
    if surfaces.shape[-2] != places.n_source:
        raise error(
            f"{name} must have {places.n_source:,} vertices, as the map has; found "
            f"{surfaces.shape[-2]:,}"
        )
    _check_bodies(surfaces, places.faces, name, places.source, error)
    if up is not None:
        return make_upright(surfaces, up=up)
    if surfaces.size and _upward(surfaces, places.source) < _UPSIDE_DOWN:
        raise error(
            f"{name} must have y pointing up; found heads below feet, as in camera coordinates: "
            'up="-y" turns the bodies upright, and up="y" accepts them unchanged'
        )
    return surfaces


def _upward(surfaces: Array, reference: Array) -> float:
    """Return the median cosine between y and the direction away from the feet."""
    # The lowest vertices of the reference, which is upright, are those of the feet.
    feet = reference[:, 1] < np.quantile(reference[:, 1], _SHARE_OF_FEET)
    directions = surfaces.mean(axis=-2) - surfaces[..., feet, :].mean(axis=-2)
    return float(np.median(unit_vectors(directions)[..., 1]))


def _rounded(points: Array) -> Array:
    """Return points rounded as in files, so that a map read back equals the one written."""
    return points.astype(np.float32).astype(np.float64)


def _vertex_places(
    placed: tuple[SurfacePoints, Array],
    source: Array,
    faces: Triangles,
    target: Array,
    target_faces: Triangles,
    parts: tuple[FilledPart, ...],
) -> VertexPlaces:
    places, heights = placed
    barycentric = _rounded(places.barycentric)
    barycentric /= barycentric.sum(axis=1, keepdims=True)
    return VertexPlaces(
        faces=faces,
        n_source=len(source),
        places=SurfacePoints(places.triangles, barycentric),
        heights=_rounded(heights),
        source=source,
        target=target,
        target_faces=target_faces,
        parts=parts,
    )


def _learned(
    places: VertexPlaces,
    lacking: Sequence[FilledPart],
    sources: Sequence[Array],
    targets: Array,
) -> VertexPlaces:
    """Return places with weights, learned from the same people on both surfaces.

    `lacking` are the parts of the source without counterpart.
    """
    usable = np.ones(places.n_source, dtype=bool)
    for part in lacking:
        usable[part.vertices] = False
    corners = places.faces[places.places.triangles]
    barycentric = places.places.barycentric
    seen, known = np.concatenate(sources), np.concatenate([targets] * len(sources))
    columns = combined_vertices(places.target, places.source, corners, usable)
    start = np.zeros(columns.shape)
    start[:, :3] = barycentric
    return _with_weights(places, columns, learned_weights(seen, known, columns, start))


def _with_weights(places: VertexPlaces, columns: Integers, weights: Array) -> VertexPlaces:
    """Return places with weights as a file holds them, whose rows sum to one."""
    rounded = _rounded(weights)
    rounded += (1.0 - rounded.sum(axis=1, keepdims=True)) / rounded.shape[1]
    return replace(places, columns=columns, weights=rounded)


def _applied(places: VertexPlaces, surfaces: Array) -> Array:
    lead = surfaces.shape[:-2]
    with single_threaded_libraries():
        mapped = [places.apply(surfaces[index]) for index in np.ndindex(lead)]
    return np.array(mapped).reshape(*lead, len(places.heights), 3)


def _body_and_faces(template: object, faces: ArrayLike | None) -> tuple[Array, Triangles]:
    """Return a body and its triangles."""
    if isinstance(template, (str, os.PathLike)):
        return load_mesh(template)
    return as_arrays(template) if faces is None else check_mesh(template, faces)


def _check_bodies(
    surfaces: Array, faces: Triangles, name: str, known: Array, error: type[Exception]
) -> None:
    """Refuse other units and mirrored bodies."""
    check_same_scale(
        surfaces,
        longest_side(known),
        name,
        "the body model",
        error=error,
        remedy="the map is in metres",
    )
    refuse_mirrored(surfaces.reshape(-1, *surfaces.shape[-2:]), faces, name, error)


def _dense_model(model: BodyModel) -> tuple[BodyModel, Integers]:
    """Return the model to register, and its vertices that are the model's."""
    coarse = load_open_model("coarse")
    # The coarse model's vertices are a subset of the full model's, which fits hands far better.
    if model.n_vertices == coarse.n_vertices and np.array_equal(
        model.template.vertices, coarse.template.vertices
    ):
        full = load_open_model("full")
        return full, cKDTree(full.template.vertices).query(coarse.template.vertices)[1]
    return model, np.arange(model.n_vertices)


def _register(body: Array, faces: Triangles, model: BodyModel) -> RegisteredScan:
    component = joined_components(body, faces)
    areas = np.bincount(component[faces[:, 0]], triangle_areas(body, faces))
    large = faces[areas[component[faces[:, 0]]] > _SMALL_PART * areas.sum()]
    used, corners = np.unique(large, return_inverse=True)
    points, triangles = body[used], corners.reshape(-1, 3)
    while len(points) < _FEWEST_VERTICES:
        points, triangles = split_triangles(points, triangles)
    return ScanRegistration(model, unit="metres").solve((points, triangles))


def _smoothed_surface(result: RegisteredScan, model: BodyModel) -> Array:
    """Return the registered surface, moved along itself halfway to the model's.

    The elastic surface lies on the scan, and slides along it; the model's misses it, and slides
    otherwise. On simulated people the mean of both slides least.
    """
    fit, surface = result.fit, result.points
    if fit is None:
        return surface
    gaps = model(fit.betas, fit.pose, fit.trans, fit.hands) - surface
    normals = vertex_normals(surface, model.faces)
    gaps -= np.einsum("nx,nx->n", gaps, normals)[:, np.newaxis] * normals
    lengths = np.linalg.norm(gaps, axis=1, keepdims=True)
    gaps *= np.minimum(1.0, _LONGEST_SLIDE / np.maximum(lengths, np.finfo(float).tiny))
    moved: Array = surface + 0.5 * gaps
    return moved


def _model_with(model: BodyModel | None, faces: Triangles, n_vertices: int) -> BodyModel:
    candidates = [load_open_model(resolution) for resolution in ("full", "coarse")]
    for candidate in candidates if model is None else [model]:
        if candidate.n_vertices == n_vertices and np.array_equal(candidate.faces, faces):
            return candidate
    expected = "the model given" if model is not None else "the open models"
    raise FileFormatError(
        f"its map is for a model with {n_vertices:,} vertices and {len(faces):,} triangles, "
        f"unlike {expected}: pass the model of the map"
    )


def _stored_places(name: str, places: VertexPlaces) -> dict[str, Values]:
    stored = {
        f"{name}_triangles": places.places.triangles.astype(np.int32),
        f"{name}_barycentric": places.places.barycentric.astype(np.float32),
        f"{name}_heights": places.heights.astype(np.float32),
    }
    if places.columns is not None and places.weights is not None:
        stored[f"{name}_columns"] = places.columns.astype(np.int32)
        stored[f"{name}_weights"] = places.weights.astype(np.float32)
    return stored


def _read_places(
    name: str, arrays: Mapping[str, Values], n_points: int, n_faces: int
) -> tuple[SurfacePoints, Array]:
    triangles = index_array(arrays[f"{name}_triangles"], f"{name}_triangles", (n_points,), n_faces)
    barycentric = real_array(
        arrays[f"{name}_barycentric"], f"{name}_barycentric", (n_points, 3), batched=False
    )
    heights = real_array(arrays[f"{name}_heights"], f"{name}_heights", (n_points,), batched=False)
    return SurfacePoints(triangles, np.asarray(barycentric)), np.asarray(heights)


def _with_read_weights(
    name: str, arrays: Mapping[str, Values], places: VertexPlaces
) -> VertexPlaces:
    """Return places with the weights in a file, if it has any."""
    if f"{name}_weights" not in arrays or f"{name}_columns" not in arrays:
        return places
    shape = (len(places.heights), "k")
    weights = real_array(arrays[f"{name}_weights"], f"{name}_weights", shape, batched=False)
    columns = index_array(
        arrays[f"{name}_columns"], f"{name}_columns", weights.shape, places.n_source
    )
    return _with_weights(places, columns, np.asarray(weights, dtype=float))


def _stored_parts(name: str, parts: Sequence[FilledPart]) -> dict[str, Values]:
    """Return names of parts, and a table of part, vertex, and whether it is an anchor."""
    rows = [np.zeros((0, 3), dtype=np.int32)]
    for number, part in enumerate(parts):
        for is_anchor, vertices in enumerate((part.vertices, part.anchors)):
            columns = np.full(len(vertices), number), vertices, np.full(len(vertices), is_anchor)
            rows.append(np.stack(columns, axis=1).astype(np.int32))
    names = np.array([part.name for part in parts], dtype=np.str_)
    return {f"{name}_part_names": names, f"{name}_part_numbers": np.concatenate(rows)}


def _read_parts(name: str, arrays: Mapping[str, Values], n_vertices: int) -> tuple[FilledPart, ...]:
    rows = index_array(arrays[f"{name}_part_numbers"], f"{name}_part_numbers", ("n", 3), n_vertices)
    parts = []
    for number, part_name in enumerate(arrays[f"{name}_part_names"].tolist()):
        part_rows = rows[rows[:, 0] == number]
        vertices, anchors = (part_rows[part_rows[:, 2] == flag, 1] for flag in (0, 1))
        parts.append(FilledPart(str(part_name), vertices, anchors))
    return tuple(parts)
