# SPDX-License-Identifier: MIT
"""mechanism.py - a platform in double precision, from its INI file: joints, cylinder lengths, Jacobian, singularity margin.

Independent of the core: a pose is turned one axis after the other, rates are differences of joint positions, eigenvalues come from
Jacobi's rotations, and the forward solution from damped Gauss-Newton steps on those differences.
"""
import configparser
import math

AXES = ("roll", "pitch", "yaw", "x", "y", "z")
FREE = {"hexapod": (0, 1, 2, 3, 4, 5), "tripod": (0, 1, 5), "tripod-3rps": (0, 1, 5)}
STEP = 1e-4  # of a difference, deg or mm


def turn(point, roll, pitch, yaw):
    """A point turned about X, then Y, then Z (degrees)."""
    x, y, z = point
    c, s = math.cos(math.radians(roll)), math.sin(math.radians(roll))
    y, z = c * y - s * z, s * y + c * z
    c, s = math.cos(math.radians(pitch)), math.sin(math.radians(pitch))
    x, z = c * x + s * z, -s * x + c * z
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    return c * x - s * y, s * x + c * y, z


def eigenvalues(matrix):
    """Of a symmetric matrix, by Jacobi's rotations."""
    a = [row[:] for row in matrix]
    n = len(a)
    for _ in range(60):
        if sum(a[i][j] ** 2 for i in range(n) for j in range(i)) < 1e-30 * max(1e-300, sum(a[i][i] ** 2 for i in range(n))):
            break
        for p in range(n):
            for q in range(p + 1, n):
                if a[p][q] == 0.0:
                    continue
                theta = (a[q][q] - a[p][p]) / (2 * a[p][q])
                t = math.copysign(1.0, theta) / (abs(theta) + math.hypot(theta, 1.0))
                c = 1 / math.hypot(t, 1.0)
                s = t * c
                for k in range(n):
                    a[k][p], a[k][q] = c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]
                for k in range(n):
                    a[p][k], a[q][k] = c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]
    return [a[i][i] for i in range(n)]


def solve(matrix, rhs):
    """Gaussian elimination; None where the matrix is singular."""
    n = len(rhs)
    a = [row[:] + [value] for row, value in zip(matrix, rhs)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda row: abs(a[row][k]))
        if abs(a[pivot][k]) < 1e-14:
            return None
        a[k], a[pivot] = a[pivot], a[k]
        for row in range(n):
            if row != k:
                factor = a[row][k] / a[k][k]
                a[row] = [x - factor * y for x, y in zip(a[row], a[k])]
    return [a[k][n] / a[k][k] for k in range(n)]


def numbers(text):
    return [float(part) for part in text.split(";")[0].split(",")]


class Mechanism:
    def __init__(self, path):
        ini = configparser.ConfigParser(inline_comment_prefixes=(";",), strict=True)
        ini.read(path, encoding="utf-8")
        geometry = ini["geometry"]
        self.ini = ini
        self.kind = ini["platform"]["kind"]
        self.free = FREE[self.kind]
        self.count = 6 if self.kind == "hexapod" else 3
        self.base = [numbers(geometry[f"base{i + 1}_mm"]) for i in range(self.count)]
        self.plate = [numbers(geometry[f"plate{i + 1}_mm"]) for i in range(self.count)]
        self.retracted = self.per_cylinder(geometry["retracted_length_mm"])
        self.stroke = self.per_cylinder(geometry["stroke_mm"])
        self.height = float(geometry["zero_height_mm"])
        self.mrp = numbers(geometry.get("mrp_mm", "0, 0, 0"))
        self.margin = float(ini["cylinders"].get("margin_mm", "0"))
        self.neutral = numbers(ini["pose"]["neutral"])
        self.settled = float(ini["pose"]["settled_extension_mm"])

    def per_cylinder(self, text):
        values = numbers(text)
        return values if len(values) == self.count else values * self.count

    def limit(self, axis, what):
        unit = "deg" if axis < 3 else "mm"
        suffix = {"speed": "_s", "accel": "_s2", "jerk": "_s3"}.get(what, "")
        return float(self.ini[AXES[axis]][f"{what}_{unit}{suffix}"])

    def complete(self, pose):
        """With what the mechanism imposes: the yaw, x and y of hinges found by making every joint lie in its plane."""
        pose = list(pose)
        if self.kind == "tripod":
            pose[2] = pose[3] = pose[4] = 0.0
        if self.kind == "tripod-3rps":
            pose[2:5] = 0.0, 0.0, 0.0
            for _ in range(30):
                off = self.beside(pose)
                if max(map(abs, off)) < 1e-12:
                    break
                columns = []
                for axis in (2, 3, 4):
                    moved = pose[:]
                    moved[axis] += STEP
                    columns.append([(a - b) / STEP for a, b in zip(self.beside(moved), off)])
                change = solve([[columns[k][i] for k in range(3)] for i in range(3)], [-value for value in off])
                for axis, value in zip((2, 3, 4), change):
                    pose[axis] += value
        return pose

    def beside(self, pose):
        """How far each plate joint of a 3-RPS is beside the plane of its hinge."""
        joints = self.joints(pose)
        return [math.cos(math.radians(120 * i)) * joints[i][1] - math.sin(math.radians(120 * i)) * joints[i][0] for i in range(3)]

    def joints(self, pose):
        """Plate joints in base coordinates, of a complete pose."""
        out = []
        for joint in self.plate:
            arm = turn([joint[k] - self.mrp[k] for k in range(3)], *pose[:3])
            out.append([arm[k] + self.mrp[k] + pose[3 + k] + (self.height if k == 2 else 0.0) for k in range(3)])
        return out

    def point(self, pose, at):
        """Where a point of the plate is, of a complete pose."""
        arm = turn([at[k] - self.mrp[k] for k in range(3)], *pose[:3])
        return [arm[k] + self.mrp[k] + pose[3 + k] + (self.height if k == 2 else 0.0) for k in range(3)]

    def extensions(self, pose):
        joints = self.joints(self.complete(pose))
        return [math.dist(joints[i], self.base[i]) - self.retracted[i] for i in range(self.count)]

    def is_inside(self, pose, slack=0.0):
        return all(self.margin - slack <= e <= self.stroke[i] - self.margin + slack for i, e in enumerate(self.extensions(pose)))

    def rates(self, pose, axis):
        """mm of each cylinder per unit of an axis."""
        above, below = list(pose), list(pose)
        above[axis] += STEP
        below[axis] -= STEP
        return [(a - b) / (2 * STEP) for a, b in zip(self.extensions(above), self.extensions(below))]

    def singularity_margin(self, pose):
        """The smallest of (root mean square of the cylinders' speeds) / (that of the plate joints' speeds) over all motions."""
        pose = self.complete(pose)
        joints = self.joints(pose)
        units = [[(joints[i][k] - self.base[i][k]) / math.dist(joints[i], self.base[i]) for k in range(3)] for i in range(self.count)]
        columns = []
        for axis in self.free:
            above, below = list(pose), list(pose)
            above[axis] += STEP
            below[axis] -= STEP
            a, b = self.joints(self.complete(above)), self.joints(self.complete(below))
            columns.append([[(a[i][k] - b[i][k]) / (2 * STEP) for k in range(3)] for i in range(self.count)])
        basis = orthonormal([[value for joint in column for value in joint] for column in columns])
        if basis is None:
            return 0.0
        rows = [[sum(units[i][k] * vector[3 * i + k] for k in range(3)) for vector in basis] for i in range(self.count)]
        n = len(basis)
        gram = [[sum(row[a] * row[b] for row in rows) for b in range(n)] for a in range(n)]
        return math.sqrt(max(0.0, min(eigenvalues(gram))))

    def forward(self, extensions, guess, steps=60):
        """The complete pose near guess that has these extensions; None where none is found."""
        pose = self.complete(guess)
        for _ in range(steps):
            error = [want - have for want, have in zip(extensions, self.extensions(pose))]
            if max(map(abs, error)) < 1e-9:
                return pose
            columns = [self.rates(pose, axis) for axis in self.free]
            change = solve([[column[i] for column in columns] for i in range(self.count)], error)
            if change is None or max(map(abs, change)) > 1e6:
                return None
            scale = min(1.0, 30.0 / max(map(abs, change)))
            for axis, value in zip(self.free, change):
                pose[axis] += scale * value
            pose = self.complete(pose)
        return None


def orthonormal(vectors):
    """Gram-Schmidt, twice over; None where the vectors depend on each other."""
    basis = []
    for vector in vectors:
        size = math.hypot(*vector)
        for _ in range(2):
            for other in basis:
                share = sum(a * b for a, b in zip(vector, other))
                vector = [a - share * b for a, b in zip(vector, other)]
        length = math.hypot(*vector)
        if length < 1e-9 * max(size, 1e-300):
            return None
        basis.append([value / length for value in vector])
    return basis
