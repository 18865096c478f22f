//! MJCF, the model files of MuJoCo.
//!
//! A wheel may have several joints, so no massless links are needed between them. `priority` makes the friction of the vehicle
//! override the ground's. `condim` 6 adds rolling friction, which is a length: rolling resistance times radius. The file contains
//! no ground: include it next to a terrain, or attach it.

use super::{axis, children, escaped, head, numbers};
use sastrugi_schemas::mechanism::{GroundFriction, Joint, Link, Mechanism, Motion, Motor, Servo, Shape};
use std::fmt::Write;

pub(super) fn render(mechanism: &Mechanism) -> String {
    let mut text = String::from("<?xml version=\"1.0\"?>\n<!--\n");
    // Writing to a string cannot fail.
    for line in head(mechanism) {
        let _ = writeln!(text, "  {line}");
    }
    let _ = write!(
        text,
        "  The friction of the vehicle overrides that of the ground (priority 1). No ground: include this file next to a terrain.\n-->\n\
         <mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n  \
         <option gravity=\"0 0 -9.80665\" timestep=\"0.002\" integrator=\"implicitfast\" cone=\"elliptic\" impratio=\"10\"/>\n  <worldbody>\n",
        escaped(&mechanism.name)
    );
    children(mechanism, None).for_each(|(number, link)| body(&mut text, mechanism, number, link, 2));
    text.push_str("  </worldbody>\n");
    contacts(&mut text, mechanism);
    tendons(&mut text, mechanism);
    equalities(&mut text, mechanism);
    actuators(&mut text, mechanism);
    text.push_str("</mujoco>\n");
    text
}

/// A link with all its descendants.
fn body(text: &mut String, mechanism: &Mechanism, number: usize, link: &Link, depth: usize) {
    let indent = "  ".repeat(depth);
    let origin = match link.parent {
        Some(_) => link.origin_m,
        None => [0.0, 0.0, mechanism.standing_height_m],
    };
    let name = escaped(&link.name);
    let _ = writeln!(text, "{indent}<body name=\"{name}\" pos=\"{}\">", numbers(&origin));
    if link.parent.is_none() {
        let _ = writeln!(text, "{indent}  <freejoint name=\"{name}\"/>");
    }
    let _ = writeln!(
        text,
        "{indent}  <inertial pos=\"{}\" mass=\"{}\" diaginertia=\"{}\"/>",
        numbers(&link.centre_of_mass_m),
        link.mass_kg,
        numbers(&link.inertia_kg_m2)
    );
    for one in &link.joints {
        let _ = writeln!(text, "{indent}  {}", joint(one));
    }
    if let Some(shape) = &link.shape {
        let _ = writeln!(text, "{indent}  {}", geom(&name, shape, &mechanism.friction));
    }
    children(mechanism, Some(number)).for_each(|(child, link)| body(text, mechanism, child, link, depth + 1));
    let _ = writeln!(text, "{indent}</body>");
}

fn joint(joint: &Joint) -> String {
    let kind = match joint.motion {
        Motion::SlideZ => "slide",
        Motion::TurnY | Motion::TurnZ => "hinge",
    };
    let mut text = format!("<joint name=\"{}\" type=\"{kind}\" axis=\"{}\"", escaped(&joint.name), axis(joint.motion));
    if let Some(range) = joint.range {
        let _ = write!(text, " range=\"{}\"", numbers(&range));
    }
    if joint.damping > 0.0 {
        let _ = write!(text, " damping=\"{}\"", joint.damping);
    }
    if let Some(spring) = &joint.spring {
        let _ = write!(text, " stiffness=\"{}\" springref=\"{}\"", spring.stiffness_n_m, spring.unloaded_m);
    }
    text + "/>"
}

fn geom(name: &str, shape: &Shape, friction: &GroundFriction) -> String {
    match shape {
        Shape::Box { size_m, centre_m } => format!(
            "<geom name=\"{name}\" type=\"box\" size=\"{}\" pos=\"{}\" condim=\"3\" friction=\"{}\" priority=\"1\"/>",
            numbers(&size_m.map(|side| 0.5 * side)),
            numbers(centre_m),
            numbers(&[friction.belly, 0.0, 0.0])
        ),
        Shape::Wheel { radius_m, width_m } => format!(
            "<geom name=\"{name}\" type=\"cylinder\" size=\"{}\" zaxis=\"0 1 0\" condim=\"6\" friction=\"{}\" priority=\"1\"/>",
            numbers(&[*radius_m, 0.5 * width_m]),
            numbers(&[friction.wheel, 0.0, friction.rolling * radius_m])
        ),
    }
}

/// Excludes contacts between wheels and chassis box, which may overlap.
fn contacts(text: &mut String, mechanism: &Mechanism) {
    let Some(chassis) = mechanism.links.first() else { return };
    text.push_str("  <contact>\n");
    for wheel in mechanism.links.iter().filter(|link| matches!(link.shape, Some(Shape::Wheel { .. }))) {
        let (one, other) = (escaped(&chassis.name), escaped(&wheel.name));
        let _ = writeln!(text, "    <exclude body1=\"{one}\" body2=\"{other}\"/>");
    }
    text.push_str("  </contact>\n");
}

/// Motors that drive several wheels.
fn shared(mechanism: &Mechanism) -> impl Iterator<Item = &Motor> {
    mechanism.motors.iter().filter(|motor| motor.joints.len() > 1)
}

/// The mean of the joints of each motor that drives several.
fn tendons(text: &mut String, mechanism: &Mechanism) {
    if shared(mechanism).next().is_none() {
        return;
    }
    text.push_str("  <tendon>\n");
    for motor in shared(mechanism) {
        let _ = writeln!(text, "    <fixed name=\"{}\">", escaped(&motor.name));
        let share = 1.0 / motor.joints.len() as f64;
        for joint in &motor.joints {
            let _ = writeln!(text, "      <joint joint=\"{}\" coef=\"{share}\"/>", escaped(joint));
        }
        text.push_str("    </fixed>\n");
    }
    text.push_str("  </tendon>\n");
}

/// Coupled joints: those of a motor that drives several, and those of a differential.
fn equalities(text: &mut String, mechanism: &Mechanism) {
    let driven = shared(mechanism).flat_map(|motor| {
        let first = motor.joints.first();
        motor.joints.iter().skip(1).filter_map(move |other| first.map(|first| (first, other, 1.0)))
    });
    let passive = mechanism.couplings.iter().map(|coupling| (&coupling.leader, &coupling.follower, coupling.ratio));
    let mut all = driven.chain(passive).peekable();
    if all.peek().is_none() {
        return;
    }
    text.push_str("  <equality>\n");
    for (leader, follower, ratio) in all {
        let (leader, follower) = (escaped(leader), escaped(follower));
        let _ = writeln!(text, "    <joint joint1=\"{follower}\" joint2=\"{leader}\" polycoef=\"0 {ratio} 0 0 0\"/>");
    }
    text.push_str("  </equality>\n");
}

/// A servo for every motor; its control is a speed in rad/s or an angle in rad.
fn actuators(text: &mut String, mechanism: &Mechanism) {
    text.push_str("  <actuator>\n");
    for motor in &mechanism.motors {
        let name = escaped(&motor.name);
        let target = match motor.joints.as_slice() {
            [joint] => format!("joint=\"{}\"", escaped(joint)),
            _ => format!("tendon=\"{name}\""),
        };
        let _ = match motor.servo {
            Servo::Speed { gain_n_m_s, torque_limit_n_m, speed_limit_rad_s } => writeln!(
                text,
                "    <velocity name=\"{name}\" {target} kv=\"{gain_n_m_s}\" forcerange=\"{}\" ctrlrange=\"{}\"/>",
                numbers(&[-torque_limit_n_m, torque_limit_n_m]),
                numbers(&[-speed_limit_rad_s, speed_limit_rad_s])
            ),
            Servo::Angle { stiffness_n_m, damping_n_m_s, .. } => writeln!(
                text,
                "    <position name=\"{name}\" {target} kp=\"{stiffness_n_m}\" kv=\"{damping_n_m_s}\" inheritrange=\"1\"/>"
            ),
        };
    }
    text.push_str("  </actuator>\n");
}
