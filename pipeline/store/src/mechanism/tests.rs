use super::*;
use sastrugi_schemas::mechanism::{Coupling, GroundFriction, Joint, Motor, Servo, Shape, Spring};

fn joint(name: &str, motion: Motion, range: Option<[f64; 2]>) -> Joint {
    Joint { name: name.to_owned(), motion, range, damping: 0.0, spring: None }
}

fn link(name: &str, parent: Option<usize>, joints: Vec<Joint>) -> Link {
    Link {
        name: name.to_owned(),
        parent,
        origin_m: [0.5, 0.25, 0.0],
        mass_kg: 2.0,
        centre_of_mass_m: [0.0; 3],
        inertia_kg_m2: [1.0, 1.5, 1.0],
        shape: Some(Shape::Wheel { radius_m: 0.2, width_m: 0.1 }),
        joints,
    }
}

/// A chassis with a wheel that is sprung, steered and driven, and two arms that move against each other.
fn mechanism() -> Mechanism {
    let sprung = Joint {
        damping: 100.0,
        spring: Some(Spring { stiffness_n_m: 5000.0, unloaded_m: -0.05, force_max_n: 750.0 }),
        ..joint("wheel_suspension", Motion::SlideZ, Some([-0.1, 0.125]))
    };
    let steered = joint("wheel_steering", Motion::TurnZ, Some([-0.5, 0.5]));
    let wheel = vec![sprung, steered, joint("wheel_spin", Motion::TurnY, None)];
    let arm = |name: &str| vec![joint(name, Motion::TurnY, Some([-0.75, 0.75]))];
    let chassis = Link {
        shape: Some(Shape::Box { size_m: [1.0, 0.5, 0.25], centre_m: [0.0, 0.0, 0.125] }),
        ..link("base_link", None, Vec::new())
    };
    let servo = Servo::Speed { gain_n_m_s: 10.0, torque_limit_n_m: 40.0, speed_limit_rad_s: 5.0 };
    Mechanism {
        name: "a & b".to_owned(),
        links: vec![
            chassis,
            link("wheel", Some(0), wheel),
            link("left", Some(0), arm("left_pivot")),
            link("right", Some(0), arm("right_pivot")),
        ],
        couplings: vec![Coupling { leader: "left_pivot".to_owned(), follower: "right_pivot".to_owned(), ratio: -1.0 }],
        motors: vec![Motor { name: "motor".to_owned(), joints: vec!["wheel_spin".to_owned()], servo }],
        friction: GroundFriction { surface: "study".to_owned(), wheel: 1.0, belly: 0.5, rolling: 0.05 },
        standing_height_m: 0.2,
        tyre_sag_m: 0.005,
    }
}

fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part} in\n{text}");
    }
}

/// Every opened element is closed, in order.
fn is_balanced(text: &str) {
    let mut open = Vec::new();
    for tag in text.split('<').skip(1).map(|rest| rest.split('>').next().unwrap()) {
        match tag.as_bytes() {
            [b'?' | b'!', ..] => (),
            [b'/', name @ ..] => assert_eq!(open.pop().map(str::as_bytes), Some(name), "{text}"),
            [.., b'/'] => (),
            _ => open.push(tag.split(' ').next().unwrap()),
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn val_mjcf_is_complete() {
    let text = render(&mechanism(), Format::Mjcf);
    is_balanced(&text);
    has(
        &text,
        &[
            "<mujoco model=\"a &amp; b\">",
            "<body name=\"base_link\" pos=\"0 0 0.2\">",
            "<joint name=\"wheel_suspension\" type=\"slide\" axis=\"0 0 1\" range=\"-0.1 0.125\" damping=\"100\" stiffness=\"5000\" \
             springref=\"-0.05\"/>",
            "size=\"0.2 0.05\" zaxis=\"0 1 0\"",
            "<joint joint1=\"right_pivot\" joint2=\"left_pivot\" polycoef=\"0 -1 0 0 0\"/>",
            "<velocity name=\"motor\" joint=\"wheel_spin\" kv=\"10\" forcerange=\"-40 40\" ctrlrange=\"-5 5\"/>",
        ],
    );
}

/// One joint per link: each carrier takes a hundredth of the wheel's mass, and the total mass is unchanged.
#[test]
fn val_urdf_has_carriers_limits_and_comments() {
    let text = render(&mechanism(), Format::Urdf);
    is_balanced(&text);
    has(
        &text,
        &[
            "<robot name=\"a &amp; b\">",
            "<parent link=\"wheel_suspension_carrier\"/>\n    <child link=\"wheel_steering_carrier\"/>",
            "<limit lower=\"-0.1\" upper=\"0.125\" effort=\"750\" velocity=\"100\"/>",
            "<joint name=\"wheel_spin\" type=\"continuous\">",
            "<limit effort=\"40\" velocity=\"5\"/>",
            "<mimic joint=\"left_pivot\" multiplier=\"-1\" offset=\"0\"/>",
            "<!-- spring: stiffness 5000 N/m, unloaded at -0.05 m; damping 100 N s/m -->",
        ],
    );
    let masses =
        text.split("<mass value=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse::<f64>().unwrap());
    assert!((masses.sum::<f64>() - 8.0).abs() < 1e-12, "{text}");
    assert_eq!(notes(&mechanism(), Format::Urdf).len(), 1);
    assert_eq!(notes(&mechanism(), Format::Mjcf), Vec::<String>::new());
}

#[test]
fn val_impossible_moments_of_inertia_are_named() {
    let mut mechanism = mechanism();
    mechanism.links[1].inertia_kg_m2 = [1.0, 2.5, 1.0];
    let notes = notes(&mechanism, Format::Mjcf);
    assert!(notes.len() == 1 && notes[0].contains("wheel, 2.5 kg m2"), "{notes:?}");
}

#[test]
fn val_formats_by_ending() {
    for (name, format) in [("a.xml", Some(Format::Mjcf)), ("a.URDF", Some(Format::Urdf)), ("a.tif", None), ("a", None)]
    {
        assert_eq!(Format::of_name(Path::new(name)), format, "{name}");
    }
}
