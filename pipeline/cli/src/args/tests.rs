use super::*;
use clap::{Command, CommandFactory};

/// The calls of the program in a help text; a line that ends in a backslash continues in the next.
fn examples(help: &str) -> Vec<Vec<String>> {
    let joined = help.replace("\\\n", " ");
    joined.lines().filter(|line| line.starts_with("  sastrugi ")).map(words).collect()
}

/// The words of a line as a shell hands them to the program: quotes group, and neither a redirection nor a pipe is an argument.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None::<char>);
    for c in line.chars() {
        match quote {
            Some(open) if c == open => quote = None,
            Some(_) => word.get_or_insert_with(String::new).push(c),
            None if c == '\'' || c == '"' => {
                quote = Some(c);
                word.get_or_insert_with(String::new);
            }
            None if c.is_whitespace() => words.extend(word.take()),
            None => word.get_or_insert_with(String::new).push(c),
        }
    }
    assert!(quote.is_none(), "a quote is not closed: {line}");
    words.extend(word);
    let end = words.iter().position(|word| word == ">" || word == "|").unwrap_or(words.len());
    words.truncate(end);
    words
}

/// The help of a command must have examples of it that the parser accepts, for readers who have the program but not the repository.
fn check_examples(command: &Command, verb: Option<&str>) {
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let examples = examples(&help);
    let is_of_verb = |call: &&Vec<String>| verb.is_none_or(|verb| call[1] == verb);
    let name = command.get_name();
    assert_ne!(examples.iter().filter(is_of_verb).count(), 0, "the help of {name} has no example of it: {help}");
    // A longer line is wrapped, and a wrapped command cannot be copied.
    let long: Vec<&str> = help.lines().filter(|line| line.chars().count() > 100).collect();
    assert!(long.is_empty(), "lines in the help of {name} that are wrapped: {long:?}");
    for call in &examples {
        if let Err(refused) = Arguments::try_parse_from(call) {
            panic!("an example in the help of {name} is refused: {call:?}\n{refused}");
        }
        let shipped = call.iter().find(|word| word.starts_with("fixtures/"));
        assert!(shipped.is_none(), "an example in the help of {name} names {shipped:?}, which only the repository has");
    }
}

#[test]
fn val_every_example_of_the_help_is_accepted() {
    let command = Arguments::command();
    check_examples(&command, None);
    assert_eq!(command.get_subcommands().count(), 28, "a verb was added or removed: change this number");
    for verb in command.get_subcommands() {
        check_examples(verb, Some(verb.get_name()));
    }
}

/// The reader of examples finds what a shell would: otherwise the test above would prove little.
#[test]
fn val_examples_are_split_as_by_a_shell() {
    let help = "Examples:\n  sastrugi terrain gap --set size_px='[512, 512]' \\\n    --set a=\"b c\" -o x.tif\n   \
        sastrugi is prose\n  sastrugi schema > study.schema.json\n";
    let expected: [&[&str]; 2] = [
        &["sastrugi", "terrain", "gap", "--set", "size_px=[512, 512]", "--set", "a=b c", "-o", "x.tif"],
        &["sastrugi", "schema"],
    ];
    assert_eq!(examples(help), expected);
    assert_eq!(words("  sastrugi run ''"), ["sastrugi", "run", ""]);
}

/// Every verb that writes one file names it, so that leftovers of an interrupted call are cleared before the next.
#[test]
fn val_output_files_of_verbs() {
    let output = |call: &str| {
        let arguments = Arguments::try_parse_from(words(call)).unwrap_or_else(|e| panic!("{call}: {e}"));
        arguments.verb.output_file().map(Path::to_owned)
    };
    for call in [
        "sastrugi terrain gap -o out",
        "sastrugi fit a.tif -o out",
        "sastrugi coregister a.tif b.tif -o out",
        "sastrugi texture fit.json -o out",
        "sastrugi convert a.tif out",
        "sastrugi hillshade a.tif -o out",
        "sastrugi render a.tif -o out",
        "sastrugi photoclinometry images.toml -o out",
        "sastrugi pack release -o out",
        "sastrugi roughness a.tif --classes out",
        "sastrugi analyze a.mcap -o out",
    ] {
        assert_eq!(output(call), Some(PathBuf::from("out")), "{call}");
    }
    for call in ["sastrugi run study.toml -o out", "sastrugi info a.tif", "sastrugi fit a.tif --table t.csv"] {
        assert_eq!(output(call), None, "{call}");
    }
}

/// What is checked before a verb works: all of its outputs, but not a release.
#[test]
fn val_all_outputs_of_verbs() {
    let outputs = |call: &str| {
        let arguments = Arguments::try_parse_from(words(call)).unwrap_or_else(|e| panic!("{call}: {e}"));
        let names = arguments.verb.outputs().into_iter().map(|path| path.display().to_string());
        names.collect::<Vec<_>>().join(" ")
    };
    assert_eq!(outputs("sastrugi init -o a.toml"), "a.toml");
    let fit = "sastrugi fit a.tif --minus b.tif -o o --table t --difference d --map m --background b --plot p --csv c --local l";
    assert_eq!(outputs(fit), "o t d m b p c l");
    assert_eq!(outputs("sastrugi roughness a.tif --classes c --band 1:2 --rms-map r"), "c r");
    assert_eq!(outputs("sastrugi run study.toml -o s3://b/c"), "");
}

/// Folders are allowed where a verb makes one, and where names of files only begin with the output.
#[test]
fn val_outputs_that_may_be_folders() {
    let folders = |call: &str| {
        let arguments = Arguments::try_parse_from(words(call)).unwrap_or_else(|e| panic!("{call}: {e}"));
        let verb = &arguments.verb;
        let names =
            verb.outputs().into_iter().filter(|path| verb.is_folder(path)).map(|path| path.display().to_string());
        names.collect::<Vec<_>>().join(" ")
    };
    assert_eq!(folders("sastrugi fit a.tif -o o --table t --local l"), "l");
    assert_eq!(folders("sastrugi fit a.tif b.tif -o o --table t"), "o");
    assert_eq!(folders("sastrugi convert a.tif o --for gazebo"), "o");
    assert_eq!(folders("sastrugi convert a o --for lerobot"), "o");
    for call in ["sastrugi convert a.tif o", "sastrugi terrain gap -o o", "sastrugi init -o o"] {
        assert_eq!(folders(call), "", "{call}");
    }
}
