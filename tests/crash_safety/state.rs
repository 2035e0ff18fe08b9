//! Contents of folders, to be compared.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Contents of a folder by path.
pub type State = BTreeMap<String, Vec<u8>>;

/// Contents of a folder and the folders in it. Of reports, the times of the stages are left out: they differ between equal runs.
pub fn state_of(folder: &Path) -> State {
    let mut state = State::new();
    collect(folder, folder, &mut state);
    state
}

fn collect(root: &Path, folder: &Path, state: &mut State) {
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(root, &path, state);
            if is_hidden(path.file_name().unwrap().to_str().unwrap()) {
                state.insert(name_of(root, &path), Vec::new());
            }
            continue;
        }
        let bytes = fs::read(&path).unwrap();
        let is_page = path.extension().is_some_and(|extension| extension == "html");
        state.insert(name_of(root, &path), if is_page { without_times(bytes) } else { bytes });
    }
}

fn name_of(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap().to_str().unwrap().to_owned()
}

fn without_times(page: Vec<u8>) -> Vec<u8> {
    let text = String::from_utf8(page).expect("a page is text");
    let Some((before, table)) = text.split_once("<details class=\"stages\">") else { return text.into_bytes() };
    let (_, after) = table.split_once("</details>").unwrap_or_default();
    format!("{before}{after}").into_bytes()
}

fn is_hidden(name: &str) -> bool {
    // A mark of the demo's captures is a part of them.
    name.starts_with('.') && name != ".made-by-depthcal-demo"
}

/// The visible files, and the names of hidden files and folders: what is temporary.
pub fn visible(state: &State) -> (State, Vec<String>) {
    let hidden = |path: &str| path.split('/').find(|part| is_hidden(part)).map(str::to_owned);
    let mut temporary: Vec<String> = state.keys().filter_map(|path| hidden(path)).collect();
    temporary.sort();
    temporary.dedup();
    let files = state.iter().filter(|(path, _)| hidden(path).is_none());
    (files.map(|(path, bytes)| (path.clone(), bytes.clone())).collect(), temporary)
}

/// Makes `to` a copy of `from`, or an absent folder where `from` is.
pub fn copy(from: &Path, to: &Path) {
    if to.exists() {
        fs::remove_dir_all(to).unwrap();
    }
    if from.exists() {
        copy_into(from, to);
    }
}

fn copy_into(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copy_into(&path, &target) } else { _ = fs::copy(&path, &target).unwrap() }
    }
}
