"""The base class of the tasks in which a robot drives among obstacles and balls."""

from abc import abstractmethod
from math import inf, radians
from typing import Any, NamedTuple

import torch
from torch import Tensor

from envs.core.pure import Entries, PureEnv
from envs.core.streams import Stream
from envs.robot import kinematics, layout, paths, sonar, vision
from envs.robot.collisions import collides
from envs.robot.draws import Draws
from envs.robot.geometry import Boxes, Discs, Point, Sector, Walls, between, square
from envs.robot.scene import PathConfig, SceneConfig, VisionConfig, names_of

POSE = "x_m", "y_m", "heading_rad"


class Moved(NamedTuple):
    """The outcome of a step, from which a task computes the reward. Entries are ``[*batch, 1]``.

    Attributes:
        collided: whether the robot has touched a wall or an obstacle (bool).
        ball_distance_m: the distance from the robot's centre to the centre of the nearest ball of
            kind ``ball``; infinite if there is no such ball.
        step: the number of steps in this situation, including this step.
        action: Δv, the wheels' relative speed.
    """

    collided: Tensor
    ball_distance_m: Tensor
    step: Tensor
    action: Tensor


class Arena(PureEnv):
    """A batch of fields, each with its own robot, obstacles and balls.

    The state has these entries besides those of :class:`envs.core.pure.PureEnv`. The pose and the
    action are ``[*batch_size, 1]``, all others ``[*batch_size, objects]``:

    =====================================  =======================================================
    ``x_m``, ``y_m``, ``heading_rad``      the robot's pose
    ``disc_x_m``, ``disc_y_m``,            the obstacles with random place or size
    ``disc_radius_m``, ``box_x_m``,
    ``box_y_m``, ``box_heading_rad``
    ``ball_x_m``, ``ball_y_m``,            the balls' places and motion
    ``ball_east_mps``,                     (:data:`envs.robot.paths.MOTION`)
    ``ball_north_mps``, ``ball_along``,
    ``ball_rate``, ``ball_path``
    ``sonar_m``                            each sonar's reading
    ``action``                             Δv in [−1, 1], the wheels' relative speed
    =====================================  =======================================================

    A subclass defines the reward and the end of a situation in :meth:`judge`.

    Arguments: as :class:`envs.core.pure.PureEnv`.
    """

    schema = SceneConfig
    world: SceneConfig

    ring_x_m: Tensor
    ring_y_m: Tensor
    ring_heading_rad: Tensor

    def __init__(self, world: SceneConfig, *args: Any, **settings: Any) -> None:
        super().__init__(world, *args, **settings)
        ring = [] if world.sensors.sonar is None else world.sensors.sonar.ring
        places = torch.tensor(ring, dtype=self.dtype, device=self.device).reshape(-1, 3)
        # Buffers move to another device together with the environment.
        for number, name in enumerate(("x_m", "y_m", "heading_rad")):
            column = places[:, number].clone()
            column = torch.deg2rad(column) if name == "heading_rad" else column
            self.register_buffer(f"ring_{name}", column, persistent=False)

    @property
    def state_sizes(self) -> dict[str, int]:
        """The number of values of each state entry: the pose and the entries of objects."""
        return dict.fromkeys(POSE, 1) | self._many

    @property
    def _many(self) -> dict[str, int]:
        """The number of objects in each entry of obstacles, balls and sonars."""
        world, sizes = self.world, dict[str, int]()
        for shape, keys in layout.DRAWN.items():
            drawn = sum(e.number for e in world.obstacle_entries if e.drawn and e.shape == shape)
            sizes |= dict.fromkeys(keys, drawn) if drawn else {}
        if balls := world.ball_entries:
            sizes |= {f"ball_{key}": len(balls) for key in (*paths.MOTION, "path")}
        if world.sensors.sonar is not None:
            sizes["sonar_m"] = len(world.sensors.sonar.ring)
        return sizes

    @abstractmethod
    def judge(self, moved: Moved) -> Entries:
        """Return ``reward``, ``terminated`` (bool) and ``success`` (bool) of a step."""

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        world = self.world
        when = seed.squeeze(-1), episode.squeeze(-1), torch.zeros_like(episode).squeeze(-1)
        draws = Draws(*when, Stream.LAYOUT, self.dtype)
        nothing = draws.within(0.0)
        objects = {"x_m": nothing, "y_m": nothing}
        objects["heading_rad"] = draws.within(world.robot.heading_rad)
        balls = [self._start_ball(ball.routes, draws) for ball in world.ball_entries]
        clear = [(Point(nothing, nothing), world.robot.radius_m)]
        for ball, motion in zip(world.ball_entries, balls, strict=True):
            clear.append((Point(motion["x_m"], motion["y_m"]), ball.radius_m))
        objects |= layout.draw_obstacles(world.obstacle_entries, draws, clear, world.clearance_m)
        objects |= _stacked(balls)
        sensed = self._sense(objects, Draws(*when, Stream.SENSORS, self.dtype), None)
        return self._objects_last(objects | sensed)

    def transition(self, state: Entries, action: Tensor) -> Entries:
        world, robot = self.world, self.world.robot
        before = self._objects_first(state)
        x_m, y_m, heading_rad = kinematics.drive(
            before["x_m"],
            before["y_m"],
            before["heading_rad"],
            *kinematics.wheel_speeds(action.squeeze(-1), self._speed_mps(before)),
            robot.track_width_m,
            world.time_step_s,
        )
        walls, boxes, discs = self._obstacles(before)
        start, end = Point(before["x_m"], before["y_m"]), Point(x_m, y_m)
        collided = collides(start, end, robot.radius_m, walls=walls, boxes=boxes, discs=discs)
        # After a collision the robot has its new heading but its old place.
        objects = {
            "x_m": torch.where(collided, start.x, end.x),
            "y_m": torch.where(collided, start.y, end.y),
            "heading_rad": heading_rad,
        }
        objects |= {
            key: before[key] for keys in layout.DRAWN.values() for key in keys if key in before
        }
        objects |= self._move_balls(before, walls, boxes)
        when = before["seed"], before["episode"], before["step"]
        draws = Draws(*when, Stream.SENSORS, self.dtype, self._noise(before))
        sensed = self._sense(objects, draws, before)
        distance_m = self._ball_distance_m(objects)
        moved = Moved(collided.unsqueeze(-1), distance_m.unsqueeze(-1), state["step"], action)
        return self._objects_last(objects | sensed) | self.judge(moved)

    def _objects_first(self, entries: Entries) -> Entries:
        """Return entries of objects as ``[objects, *batch]``, all others as ``[*batch]``."""
        many = self._many
        return {
            key: value.movedim(-1, 0) if key in many else value.squeeze(-1)
            for key, value in entries.items()
        }

    def _objects_last(self, entries: Entries) -> Entries:
        """Return entries of objects as ``[*batch, objects]``, all others as ``[*batch, 1]``."""
        many = self._many
        return {
            key: value.movedim(0, -1) if key in many else value.unsqueeze(-1)
            for key, value in entries.items()
        }

    def obstacles(self, state: Entries) -> tuple[Walls | None, Boxes | None, Discs | None]:
        """Return a state's walls, boxes and discs; boxes and discs are ``[objects, *batch]``."""
        return self._obstacles(self._objects_first(state))

    def _speed_mps(self, before: Entries) -> float | Tensor:
        """Return V₀, the speed of both wheels if Δv = 0."""
        return self.world.robot.speed_mps

    def _noise(self, before: Entries) -> Tensor | None:
        """Return a factor on the errors of all sensors, ``[*batch]``; None for 1."""
        return None

    def _start_ball(self, routes: list[PathConfig], draws: Draws) -> paths.Motion:
        """Draw one of a ball's paths and the ball's motion at its start."""
        starts = [paths.start(route, draws) for route in routes]
        nothing = torch.zeros_like(starts[0]["x_m"])
        which = torch.floor(len(routes) * draws.uniform()) if len(routes) > 1 else nothing
        return _chosen(which, starts) | {"path": which}

    def _move_balls(
        self, before: Entries, walls: Walls | None, boxes: Boxes | None
    ) -> dict[str, Tensor]:
        """Return the balls' state entries after a step."""
        moved = []
        for number, ball in enumerate(self.world.ball_entries):
            motion = {key: before[f"ball_{key}"][number] for key in paths.MOTION}
            which = before["ball_path"][number]
            ends = [
                paths.move(route, motion, self.world.time_step_s, ball.radius_m, walls, boxes)
                for route in ball.routes
            ]
            moved.append(_chosen(which, ends) | {"path": which})
        return _stacked(moved)

    def _obstacles(self, objects: Entries) -> tuple[Walls | None, Boxes | None, Discs | None]:
        """Return the walls, boxes and discs; boxes and discs are ``[objects, *batch]``."""
        world, like = self.world, objects["heading_rad"]
        size_m = world.field_size_m
        walls = None if size_m is None else Walls(size_m[0] / 2, size_m[1] / 2)
        entries = world.obstacle_entries
        return (
            walls,
            layout.boxes_of(entries, objects, like),
            layout.discs_of(entries, objects, like),
        )

    def _balls(self, objects: Entries) -> Discs:
        """Return the balls as discs, each entry ``[balls, *batch]``."""
        x_m = objects["ball_x_m"]
        radii = [torch.full_like(x_m[0], ball.radius_m) for ball in self.world.ball_entries]
        return Discs(x_m, objects["ball_y_m"], torch.stack(radii))

    def _sense(self, objects: Entries, draws: Draws, before: Entries | None) -> Entries:
        """Return the observations and all sonar readings.

        Args:
            objects: the entries of the pose, the obstacles and the balls.
            draws: the random numbers of the step.
            before: the entries before the step; None at the start of a situation.
        """
        sensors, seen = self.world.sensors, Entries()
        walls, boxes, discs = self._obstacles(objects)
        if (config := sensors.sonar) is not None:
            ring = sonar.Ring(self.ring_x_m, self.ring_y_m, self.ring_heading_rad)
            limit = config.max_incidence_deg
            sector = Sector(
                radians(config.beam_width_deg) / 2, None if limit is None else radians(limit)
            )
            echoing = discs
            if config.sees_balls and self.world.ball_entries:
                balls = self._balls(objects)
                echoing = balls if discs is None else discs.and_those(balls)
            exact_m = sonar.distances(
                Point(objects["x_m"], objects["y_m"]),
                objects["heading_rad"],
                ring,
                sector,
                walls=walls,
                boxes=boxes,
                discs=echoing,
            )
            noisy = config.noise_m > 0 or config.noise_share > 0
            sonar_m = sonar.readings(
                exact_m,
                draws.normals(len(exact_m)) if noisy else None,
                draws.chances(len(exact_m), config.dropout),
                noise_m=config.noise_m,
                noise_share=config.noise_share,
                range_m=(config.range_m[0], config.range_m[1]),
            )
            seen["sonar_m"] = sonar_m
            for name, members in config.groups.items():
                seen[name] = torch.stack([sonar_m[member] for member in members]).amin(0)
        if sensors.vision is not None:
            seen |= self._look(sensors.vision, objects, boxes, discs, draws, before)
        return seen

    def _look(
        self,
        config: VisionConfig,
        objects: Entries,
        boxes: Boxes | None,
        discs: Discs | None,
        draws: Draws,
        before: Entries | None,
    ) -> Entries:
        """Return bearing, distance and visibility of the nearest ball of each kind."""
        eye, balls = Point(objects["x_m"], objects["y_m"]), self._balls(objects)
        way = between(eye, balls.centre)
        distance_m = torch.sqrt(square(way))
        true_rad = vision.wrap(torch.atan2(way.y, way.x) - objects["heading_rad"])
        edge_rad = config.field_of_view_rad
        visible = vision.in_sight(
            true_rad, distance_m, field_of_view_rad=edge_rad, range_m=config.range_m
        ) & ~vision.hidden(eye, balls, boxes=boxes, discs=discs)
        entries, seen = self.world.ball_entries, Entries()
        for kind in config.kinds:
            own = [i for i, ball in enumerate(entries) if ball.kind == kind]
            its_m, its_rad, can = (
                torch.stack([values[i] for i in own]) for values in (distance_m, true_rad, visible)
            )
            found, seen_m, seen_rad = vision.nearest(its_m, can, its_rad)
            if (missed := draws.chances(1, config.miss_probability)) is not None:
                found = found & ~missed[0]
            if config.bearing_noise_rad > 0:
                seen_rad = seen_rad + config.bearing_noise_rad * draws.normals(1)[0]
            seen_rad = vision.rounded(seen_rad, config.resolution_rad).clamp(-edge_rad, edge_rad)
            if config.distance_noise_share > 0:
                seen_m = seen_m * (1 + config.distance_noise_share * draws.normals(1)[0])
            bearing, distance, is_seen = names_of(kind)
            if config.unseen == "saturate":
                _, _, away_rad = vision.nearest(its_m, torch.ones_like(can), its_rad)
                unseen_rad = torch.where(away_rad < 0, -edge_rad, edge_rad)
            elif config.unseen == "hold" and before is not None:
                unseen_rad = before[bearing]
            else:
                unseen_rad = torch.zeros_like(seen_rad)
            seen[bearing] = torch.where(found, seen_rad, unseen_rad)
            seen[distance] = torch.where(found, seen_m.clamp(0, config.range_m), config.range_m)
            seen[is_seen] = found.to(self.dtype)
        return seen

    def _ball_distance_m(self, objects: Entries) -> Tensor:
        """Return the distance to the nearest ball of kind ``ball``, ``[*batch]``."""
        least = torch.full_like(objects["x_m"], inf)
        robot = Point(objects["x_m"], objects["y_m"])
        for number, ball in enumerate(self.world.ball_entries):
            if ball.kind == "ball":
                place = Point(objects["ball_x_m"][number], objects["ball_y_m"][number])
                least = torch.minimum(least, torch.sqrt(square(between(robot, place))))
        return least


def _chosen(which: Tensor, options: list[paths.Motion]) -> paths.Motion:
    """Return for each batch element the option with the number in ``which``."""
    motion = options[0]
    for number, other in enumerate(options[1:], start=1):
        motion = {key: torch.where(which == number, other[key], motion[key]) for key in other}
    return motion


def _stacked(balls: list[paths.Motion]) -> Entries:
    """Return the state entries of all balls, each ``[balls, *batch]``; empty without balls."""
    keys = balls[0] if balls else ()
    return {f"ball_{key}": torch.stack([motion[key] for motion in balls]) for key in keys}
