//! Checks properties of the code base as a whole.

use std::{collections::BTreeSet, fs, path::Path};

use glint::stages::NAMES;
use serde_json::Value;

fn files(folder: &Path, extension: &str, into: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, extension, into);
        } else if path.extension().is_some_and(|e| e == extension) {
            into.push(path);
        }
    }
}

#[test]
fn every_kernel_has_a_stage_and_a_twin_of_its_name() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut kernels = Vec::new();
    files(&root.join("glsl"), "comp", &mut kernels);
    assert!(kernels.len() > 25 && kernels.len() == NAMES.len());
    // `tests/verify.rs` checks that each stage is compared with its twin.
    for kernel in kernels {
        let name = kernel.file_stem().unwrap().to_str().unwrap();
        assert!(NAMES.contains(&name), "{name}");
        assert!(root.join("src/reference").join(format!("{name}.rs")).exists(), "{name} has no twin");
    }
}

/// Names that a file imports from the crate: `crate::NAME` and the first level of `crate::{…}`.
fn imports(code: &str) -> BTreeSet<&str> {
    let word = |text: &str| text.find(|c: char| !c.is_ascii_lowercase()).unwrap_or(text.len());
    let mut names = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let Some(group) = rest.strip_prefix('{') else {
            names.insert(&rest[..word(rest)]);
            continue;
        };
        let (mut depth, mut first) = (0, 0);
        for (at, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth > 0 => depth -= 1,
                ',' | '}' if depth == 0 => {
                    let name = group[first..at].trim_start();
                    names.insert(&name[..word(name)]);
                    first = at + 1;
                    if c == '}' {
                        break;
                    }
                }
                _ => {}
            }
        }
    }
    names
}

#[test]
fn a_folder_imports_only_folders_before_it() {
    const ORDER: [&str; 11] =
        ["gpu", "error", "stages", "scene", "data", "pipelines", "reference", "report", "verify", "c", "cli"];
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut sources = Vec::new();
    files(&src, "rs", &mut sources);
    let mut seen = BTreeSet::new();
    for path in &sources {
        let first = path.strip_prefix(&src).unwrap().iter().next().unwrap().to_str().unwrap();
        let Some(own) = ORDER.iter().position(|folder| *folder == first.trim_end_matches(".rs")) else { continue };
        let text = fs::read_to_string(path).unwrap();
        let code = text.split("mod tests {").next().unwrap().lines();
        let code: Vec<&str> = code.filter(|line| !line.trim_start().starts_with("//")).collect();
        for name in imports(&code.join("\n")) {
            let Some(other) = ORDER.iter().position(|folder| *folder == name) else { continue };
            assert!(other <= own, "{path:?} imports {name}");
            seen.insert((other, own));
        }
    }
    assert!(seen.len() > 25, "{} kinds of imports found", seen.len());
}

#[test]
fn unsafe_code_is_in_the_vulkan_layer_and_where_a_caller_hands_over_handles() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = Vec::new();
    files(&root.join("src"), "rs", &mut sources);
    // The viewer has its own window, instance, device and swapchain, and lends them to glint like any
    // renderer.
    let home = |path: &&std::path::PathBuf| {
        let hands_over = path.ends_with("frames.rs") || path.ends_with("cli/view/screen.rs");
        hands_over || ["src/gpu", "src/c"].iter().any(|folder| path.starts_with(root.join(folder)))
    };
    for path in sources.iter().filter(|path| !home(path)) {
        let text = fs::read_to_string(path).unwrap();
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        assert!(!code.into_iter().any(|line| line.contains("unsafe {") || line.contains("unsafe fn")), "{path:?}");
    }
}

/// A block of tests/guards.txt: the removed code, and the test that must then fail.
struct Guard<'a> {
    name: &'a str,
    /// File and name of the test.
    test: (&'a str, &'a str),
    /// For each place in the source, the number of braces that the replacement leaves open.
    open: Vec<i32>,
}

/// Opened minus closed braces of a line.
fn open_braces(line: &str) -> i32 {
    let code = line.split_once("//").map_or(line, |(code, _)| code);
    code.chars().map(|c| i32::from(c == '{') - i32::from(c == '}')).sum()
}

/// Guards in the source, one entry per place in the order of paths: name, and the number of braces that the
/// guarded lines leave open.
fn guarded_places(root: &Path) -> Vec<(String, i32)> {
    let mut sources = Vec::new();
    for (folder, extension) in [("glsl", "comp"), ("glsl", "glsl"), ("src", "rs")] {
        files(&root.join(folder), extension, &mut sources);
    }
    sources.sort_by_key(|path| path.to_str().unwrap().to_owned());
    let mut places = Vec::new();
    for path in sources {
        let text = fs::read_to_string(path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        for (at, line) in lines.iter().enumerate() {
            let Some((code, list)) = line.split_once("// guard: ") else { continue };
            let (list, count) = list.split_once(" (").unwrap_or((list, "1 lines)"));
            let count: usize = count.strip_suffix(" lines)").unwrap().parse().unwrap();
            // A guard comment on its own line precedes the guarded code; other such lines may come between.
            let stands_for = |line: &&&str| !code.trim().is_empty() || !line.trim_start().starts_with("// guard: ");
            let open =
                lines[at..].iter().skip_while(|line| !stands_for(line)).take(count).map(|l| open_braces(l)).sum();
            places.extend(list.split("; ").map(|name| (name.to_owned(), open)));
        }
    }
    places
}

/// `tools/guards` removes each guard and runs its test. This test checks that every guard exists in the
/// source and has a test, and that every row of docs/extremes.md has a guard or a reason.
#[test]
fn every_extreme_has_its_guards_and_every_guard_its_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| fs::read_to_string(root.join(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
    let text = read("tests/guards.txt");
    let (mut guards, mut section, mut row) = (Vec::<Guard>::new(), "", "");
    let (mut served, mut mentioned) = (BTreeSet::new(), Vec::new());
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.is_empty() && !line.starts_with("# ")) {
        let bad = format!("tests/guards.txt, line {}: {line}", number + 1);
        match line.split_once(' ') {
            Some(("##", name)) => (section, row) = (name, ""),
            Some(("|", name)) => row = name,
            Some(("=", reason)) => {
                served.insert((section, row));
                mentioned.extend(reason.split('[').skip(1).map(|s| s.split_once(']').expect(&bad).0));
            }
            Some(("+", code)) => {
                *guards.last_mut().and_then(|guard| guard.open.last_mut()).expect(&bad) += open_braces(code)
            }
            _ if line == "#" || line == "+" => {}
            _ if line == "&" => guards.last_mut().expect(&bad).open.push(0),
            _ if line.starts_with('[') => {
                served.insert((section, row));
                let (name, test) = line[1..].split_once("] ").expect(&bad);
                guards.push(Guard { name, test: test.split_once(' ').expect(&bad), open: vec![0] });
            }
            _ => panic!("{bad}"),
        }
    }
    // The tool changes the line that loads kernels, and finds it by its text.
    let tool = read("tools/guards");
    let loads = tool.split("my $LOADS = '").nth(1).and_then(|rest| rest.split('\'').next()).unwrap();
    assert!(read("src/gpu/pipeline.rs").contains(loads), "tools/guards looks for `{loads}` in src/gpu/pipeline.rs");
    let mut names = BTreeSet::new();
    let there = guarded_places(root);
    for Guard { name, test: (file, function), open } in &guards {
        assert!(names.insert(*name), "[{name}] is there twice");
        let places: Vec<i32> = there.iter().filter(|(place, _)| place == name).map(|(_, open)| *open).collect();
        // If lines have moved, braces often no longer match.
        assert_eq!(
            &places, open,
            "places of [{name}] in the source, and the braces that each and its change leave open"
        );
        // A test of the library is named with its modules; the last one is `tests`.
        let (path, function) = match (*file, function.split_once("::tests::")) {
            ("lib", Some((module, function))) => (format!("src/{}.rs", module.replace("::", "/")), function),
            (file, _) => match function.split_once("::") {
                Some((module, function)) => (format!("tests/{file}/{module}.rs"), function),
                None => (format!("tests/{file}.rs"), *function),
            },
        };
        let test = format!("fn {function}()");
        assert!(read(&path).lines().any(|line| line.trim_start().starts_with(&test)), "[{name}]: no {test} in {path}");
    }
    assert!(guards.len() > 40);
    let unknown: Vec<_> = there.iter().map(|(name, _)| name).filter(|name| !names.contains(name.as_str())).collect();
    assert!(unknown.is_empty(), "in the source, but not in tests/guards.txt: {unknown:#?}");
    for name in mentioned {
        assert!(names.contains(name), "[{name}] is mentioned but not there");
    }

    let doc = read("docs/extremes.md");
    let mut wanted = BTreeSet::new();
    let (mut section, mut bare) = ("", true);
    let lines: Vec<&str> = doc.lines().collect();
    for (at, line) in lines.iter().enumerate() {
        if let Some(name) = line.strip_prefix("## ") {
            if bare && !section.is_empty() {
                wanted.insert((section, ""));
            }
            (section, bare) = (name, true);
        } else if let Some(cell) = line.strip_prefix("| ").and_then(|line| line.split(" | ").next()) {
            // The first row is the table's head, followed by the line of dashes.
            if lines.get(at + 1).is_none_or(|next| !next.starts_with("|---")) {
                wanted.insert((section, cell));
            }
            bare = false;
        }
    }
    if bare {
        wanted.insert((section, ""));
    }
    // Guards that no test on llvmpipe can check.
    wanted.insert(("Not taken away", ""));
    let missing: Vec<_> = wanted.difference(&served).collect();
    let strange: Vec<_> = served.difference(&wanted).collect();
    assert!(missing.is_empty(), "of docs/extremes.md, but not in tests/guards.txt: {missing:#?}");
    assert!(strange.is_empty(), "in tests/guards.txt, but not of docs/extremes.md: {strange:#?}");
}

/// Rust in the documents is made of lines of programs that the tests run.
#[test]
fn rust_in_the_documents_is_taken_from_programs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| fs::read_to_string(root.join(path)).unwrap();
    let programs = ["examples/frames.rs", "examples/train.rs", "tests/outside/mesh/src/main.rs"].map(read).concat();
    let lines: BTreeSet<&str> = programs.lines().map(str::trim).collect();
    for path in ["README.md", "docs/embedding.md"] {
        let text = read(path);
        let blocks = text.split("```rust").skip(1).filter_map(|rest| rest.split("```").next());
        for line in blocks.flat_map(|block| block.lines().skip(1)) {
            let code = line.split_once(" //").map_or(line, |(code, _)| code).trim();
            assert!(lines.contains(code), "{path}: no program has `{code}`");
        }
    }
}

/// The measurements of an id: bench/results/ID.json or ID.jsonl, one object or several.
fn measured(id: &str) -> Value {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bench/results");
    let texts = ["json", "jsonl"].map(|extension| fs::read_to_string(folder.join(format!("{id}.{extension}"))));
    let text = texts.into_iter().find_map(Result::ok).unwrap_or_else(|| panic!("no measurements of {id}"));
    let mut values: Vec<Value> = serde_json::Deserializer::from_str(&text).into_iter().map(Result::unwrap).collect();
    if values.len() == 1 { values.remove(0) } else { values.into() }
}

/// Whether `shown` is `value`, rounded to the decimals of `shown`.
fn shows(shown: &str, value: &Value) -> bool {
    let Some(number) = value.as_f64() else { return value.as_str() == Some(shown) };
    let shown = shown.replace(',', "");
    let decimals = shown.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    format!("{number:.decimals$}").trim_start_matches('0') == shown.trim_start_matches(['0', '+'])
}

/// The mean of a field over records.
fn mean(records: &[&Value], field: &str) -> Value {
    (records.iter().map(|record| record[field].as_f64().unwrap()).sum::<f64>() / records.len() as f64).into()
}

/// Figures name the measurement (`bench/figures` makes it) that they come from, in a comment before them:
///
/// - `rows: ID FIELD...`: a table whose rows are the records, and whose columns are these fields;
/// - `means: ID ROW COLUMN FIELD...`: a table whose cells have the means of these fields over the records with the cell's ROW and COLUMN;
/// - `figure: ID POINTER`: a number in a text.
#[test]
fn figures_are_those_of_their_measurements() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = fs::read_to_string(root.join("bench/figures")).unwrap();
    let mut checked = 0;
    for page in ["README.md", "docs/benchmarks.md"] {
        let text = fs::read_to_string(root.join(page)).unwrap();
        let mut check = |shown: &str, value: &Value| {
            assert!(shows(shown, value), "{page}: `{shown}`, but {value} was measured");
            checked += 1;
        };
        for (marker, rest) in text.split("<!-- ").skip(1).filter_map(|rest| rest.split_once(" -->")) {
            let words: Vec<&str> = marker.split(' ').collect();
            let [kind @ ("rows:" | "means:" | "figure:"), id, fields @ ..] = &words[..] else { continue };
            assert!(
                script.contains(&format!("    {id}) ")) || script.contains(&format!("    {id})\n")),
                "bench/figures lacks {id}"
            );
            let all = measured(id);
            if *kind == "figure:" {
                let shown = rest.split_whitespace().next().unwrap();
                check(shown, all.pointer(fields[0]).unwrap_or_else(|| panic!("{page}: {marker}")));
                continue;
            }
            let records = all.get("scenes").unwrap_or(&all).as_array().unwrap();
            let cells = |line: &str| line.trim_matches('|').split('|').map(|c| c.trim().to_owned()).collect::<Vec<_>>();
            let lines: Vec<_> = rest.trim_start().lines().take_while(|line| line.starts_with('|')).map(cells).collect();
            let [head, _, lines @ ..] = &lines[..] else { panic!("{page}: no table after {marker}") };
            if *kind == "rows:" {
                assert_eq!(lines.len(), records.len(), "{page}: {marker}");
                for (line, record) in lines.iter().zip(records) {
                    assert_eq!(line.len(), fields.len(), "{page}: {marker}");
                    line.iter().zip(fields).for_each(|(cell, field)| check(cell, &record[*field]));
                }
                continue;
            }
            let [row, column, fields @ ..] = fields else { panic!("{marker}") };
            for line in lines {
                for (name, cell) in head.iter().zip(line).skip(1) {
                    let of = |record: &&Value| record[*row] == line[0] && record[*column] == **name;
                    let found: Vec<&Value> = records.iter().filter(of).collect();
                    let parts: Vec<&str> = cell.split(" / ").filter(|part| !part.is_empty()).collect();
                    let expected = if found.is_empty() { 0 } else { fields.len() };
                    assert_eq!(parts.len(), expected, "{page}: {name} of {}: `{cell}`", line[0]);
                    parts.iter().zip(fields).for_each(|(part, field)| check(part, &mean(&found, field)));
                }
            }
        }
    }
    assert!(checked > 60, "{checked} figures");
}

/// Tables of decimals, and decibels and milliseconds in the text, name a measurement.
#[test]
fn no_figure_is_without_a_measurement() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let decimal = |text: &str| text.contains('.') && text.trim().replace(['+', '−'], "").parse::<f64>().is_ok();
    for page in ["README.md", "docs/benchmarks.md"] {
        let mut marked = false;
        for line in fs::read_to_string(root.join(page)).unwrap().lines() {
            let marker = line.starts_with("<!-- rows: ") || line.starts_with("<!-- means: ");
            marked = marker || (marked && (line.is_empty() || line.starts_with('|')));
            let cells = line.split('|').flat_map(|cell| cell.split(" / ")).any(decimal);
            let words: Vec<&str> = line.split(' ').collect();
            let unit = |word: &str| ["dB", "ms"].contains(&word.trim_end_matches(['.', ',', ';', ':', ')']));
            let text = words.windows(2).any(|pair| decimal(pair[0]) && unit(pair[1]));
            assert!(marked || line.contains("<!-- figure: ") || !(cells || text), "{page}: no measurement of {line}");
        }
    }
}

/// Links between documents lead to files and headings that exist.
#[test]
fn links_in_the_documents_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pages = Vec::new();
    files(&root.join("docs"), "md", &mut pages);
    pages.extend(
        fs::read_dir(root)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension() == Some("md".as_ref())),
    );
    // As GitHub names headings.
    let anchor = |heading: &str| {
        let kept = heading.to_lowercase().replace(' ', "-");
        kept.chars().filter(|c| c.is_alphanumeric() || "-_".contains(*c)).collect::<String>()
    };
    let anchors = |page: &Path| -> BTreeSet<String> {
        let text = fs::read_to_string(page).unwrap_or_default();
        text.lines()
            .filter(|line| line.starts_with('#'))
            .map(|line| anchor(line.trim_start_matches('#').trim()))
            .collect()
    };
    for page in &pages {
        let text = fs::read_to_string(page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let (path, heading) = link.split_once('#').map_or((link, None), |(path, heading)| (path, Some(heading)));
            if path.starts_with("http") {
                continue;
            }
            let target = if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            assert!(target.exists(), "{}: no file {link}", page.display());
            let found = heading.is_none_or(|heading| anchors(&target).contains(heading));
            assert!(found, "{}: no heading {link}", page.display());
        }
    }
}

/// Phrases that a native reader stumbles over, each with what to write. Text is compared as words: letters in lower case, all else as one
/// space. Grow the list if a review finds another.
const PHRASES: [(&str, &str); 16] = [
    ("whoever", "name the reader, the caller or the program"),
    ("anew", "again"),
    ("goes on", "continues, resumes"),
    ("go on", "continue, resume"),
    ("going on", "running"),
    ("gone on", "continued, resumed"),
    ("find room", "fit"),
    ("finds room", "fits"),
    ("is told", "is reported; or name who says it"),
    ("are told", "are reported; or name who says it"),
    ("leans on", "relies on"),
    ("what is kept", "name the thing: checkpoint, scene, cache"),
    ("whatever it is", "any"),
    ("is no number", "is NaN"),
    ("not a sound", "not a valid"),
    ("is not sound", "is not valid"),
];

/// Words of clauses in place of nouns. A sentence rarely needs one; several in a paragraph read as a translation.
const RARE: [&str; 6] = ["what", "whoever", "of them", "as many", "which", "where"];

/// Documents, comments, help texts and messages.
#[test]
fn prose_has_none_of_the_phrases_that_reviews_have_found() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut texts = Vec::new();
    for folder in ["src", "glsl", "bench", "tests", "docs", "examples", "python"] {
        for extension in ["rs", "comp", "glsl", "h", "md", "py"] {
            files(&root.join(folder), extension, &mut texts);
        }
    }
    texts.extend(["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root.join(name)));
    texts.retain(|path| !path.ends_with("tests/house.rs") && !path.to_str().unwrap().contains("/target/"));
    assert!(texts.len() > 400);
    let (mut found, mut rare, mut all) = (Vec::new(), 0, 0);
    for path in texts {
        let rust = path.extension().is_some_and(|extension| extension == "rs");
        for (at, line) in fs::read_to_string(&path).unwrap().lines().enumerate() {
            let place = || format!("{}:{}", path.strip_prefix(root).unwrap().display(), at + 1);
            let spaced = |line: &str| {
                let line = line.to_lowercase();
                let words = line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
                words.fold(String::from(" "), |text, word| text + word + " ")
            };
            let words = spaced(line);
            let comment = line.split_once("//").map_or("", |(_, comment)| comment);
            let prose = if path.extension().is_some_and(|extension| extension == "md") { line } else { comment };
            let prose = spaced(prose);
            all += prose.split_whitespace().count();
            rare += RARE.iter().map(|word| prose.matches(&format!(" {word} ")).count()).sum::<usize>();
            for (phrase, instead) in PHRASES.iter().filter(|(phrase, _)| words.contains(&format!(" {phrase} "))) {
                if !line.contains("// guard: ") {
                    found.push(format!("{}: \"{phrase}\"; write: {instead}", place()));
                }
            }
            // A tooltip shows nothing before it.
            if rust && ["/// Of ", "/// As ", "/// The same "].iter().any(|start| line.trim_start().starts_with(start))
            {
                found.push(format!("{}: begin with the noun", place()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    assert!(1000 * rare <= 6 * all, "{rare} of {all} words are {RARE:?}; at most 6 of 1000");
}

/// Licenses that allow distribution with a list of notices, as tools/release makes one.
const LICENSES: [&str; 8] = ["0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "ISC", "MIT", "Unicode-3.0", "Zlib"];

#[test]
fn dependencies_have_permissive_licenses() {
    let mut cargo = std::process::Command::new(env!("CARGO"));
    cargo.args(["tree", "--locked", "--offline", "--edges", "normal", "--prefix", "none", "--format", "{p}|{l}"]);
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    let list = String::from_utf8(output.stdout).unwrap();
    assert!(list.lines().count() > 100, "{}", String::from_utf8_lossy(&output.stderr));
    for line in list.lines() {
        let (crate_name, license) = line.trim_end_matches(" (*)").rsplit_once('|').unwrap();
        let fits = |part: &str| {
            let mut choices = part.split(" OR ").flat_map(|choice| choice.split('/'));
            choices.any(|choice| LICENSES.contains(&choice.trim_matches(['(', ')', ' '])))
        };
        assert!(license.split(" AND ").all(fits), "{crate_name}: {license}");
    }
}
