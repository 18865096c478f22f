"""Pure pursuit and wheel speeds, implemented independently from docs/traversal.md; parameters come from the release."""

import math


def towards(value, target, change):
    return value + min(max(target - value, -change), change)


class PurePursuit:
    """Follows the straight line of a mission."""

    def __init__(self, mission, rules, drive):
        self.start = (mission["start_x_m"], mission["start_y_m"])
        self.goal = (mission["goal_x_m"], mission["goal_y_m"])
        line = (self.goal[0] - self.start[0], self.goal[1] - self.start[1])
        self.length = math.hypot(*line)
        self.direction = (line[0] / self.length, line[1] / self.length)
        self.rules, self.drive = rules, drive
        self.turning = 0.0
        self.speed = self.yaw_rate = 0.0

    def to_goal(self, x, y):
        return math.hypot(self.goal[0] - x, self.goal[1] - y)

    def update(self, x, y, yaw, period_s):
        """Sets speed and yaw rate for the next period."""
        steering, (cos, sin) = self.rules["controller"], self.direction
        along = (x - self.start[0]) * cos + (y - self.start[1]) * sin
        ahead = min(along + steering["lookahead_m"], self.length)
        dx, dy = self.start[0] + ahead * cos - x, self.start[1] + ahead * sin - y
        bearing = math.remainder(math.atan2(dy, dx) - yaw, 2 * math.pi)
        if self.turning == 0 and abs(bearing) > math.radians(steering["turn_start_deg"]):
            self.turning = math.copysign(1.0, bearing)
        elif self.turning != 0 and abs(bearing) < math.radians(steering["turn_stop_deg"]):
            self.turning = 0.0
        speed, yaw_rate = 0.0, self.turning * steering["turn_rate_rad_s"]
        if self.turning == 0:
            speed = self.rules["speed_m_s"]
            yaw_rate = steering["steering_gain"] * speed * 2 * math.sin(bearing) / max(math.hypot(dx, dy), 0.1)
        limit = self.drive["yaw_rate_limit_rad_s"]
        speed, yaw_rate = min(speed, self.drive["speed_limit_m_s"]), min(max(yaw_rate, -limit), limit)
        self.speed = towards(self.speed, speed, self.drive["acceleration_limit_m_s2"] * period_s)
        self.yaw_rate = towards(self.yaw_rate, yaw_rate, self.drive["yaw_acceleration_limit_rad_s2"] * period_s)

    def wheel_speeds(self, wheels):
        """Commanded spin of the left and right wheels, rad/s."""
        difference = 0.5 * self.yaw_rate * wheels["track_m"] * self.drive["track_multiplier"]
        return [(self.speed - difference) / wheels["radius_m"], (self.speed + difference) / wheels["radius_m"]]
