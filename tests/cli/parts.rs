//! Parts of a plan: cut, trained by themselves, and merged.

use super::*;

/// A plan of the dataset's seven training photos in two parts or more.
fn planned() -> Work {
    let work = Work::new();
    work.ok("partition data -o plan.json --photos 4");
    work
}

#[test]
fn parts_of_a_plan_are_trained_and_merged_into_a_scene_of_the_whole() {
    let work = planned();
    let plan: Value = serde_json::from_slice(&fs::read(work.path("plan.json")).unwrap()).unwrap();
    let parts = plan["parts"].as_array().unwrap();
    let count = |part: &Value, list: &str| part[list].as_array().unwrap().len();
    assert_eq!((parts.len(), parts.iter().map(|part| count(part, "photos")).sum::<usize>()), (2, 7));
    // From another folder, because a plan holds absolute paths.
    fs::create_dir(work.path("parts")).unwrap();
    for (part, listed) in parts.iter().enumerate() {
        let report = work.json(&format!("train plan.json --part {part} -o parts/{part}.ply --iterations 40 --json"));
        let photos = count(listed, "photos") + count(listed, "ring");
        assert_eq!((report["photos"].as_u64(), report["halvings"].as_u64()), (Some(photos as u64), Some(0)));
        assert!(work.ok(&format!("info parts/{part}.ply")).contains(&format!("part {part} of 2 plan ")));
    }
    let report = work.json("merge plan.json parts -o whole.ply --json");
    let kept: u64 = report["parts"].as_array().unwrap().iter().map(|part| part["kept"].as_u64().unwrap()).sum();
    assert_eq!(report["gaussians"].as_u64(), Some(kept));
    // Each part trains everything here. The border costs 0.8 dB; a merge that keeps all Gaussians of both parts loses 2.9 dB, and one
    // without a part 7.3 dB.
    let psnr = |scene: &str| work.json(&format!("eval {scene} data --json"))["base"]["psnr"].as_f64().unwrap();
    let [whole, zero, one] = ["whole.ply", "parts/0.ply", "parts/1.ply"].map(psnr);
    assert!(whole > zero.max(one) - 2.0, "{whole} {zero} {one}");
    work.refused("eval parts/0.ply plan.json --part 0 --max-size 16", &["plan.json", "--max-size"]);
    // The order of parts and of runs changes nothing.
    work.ok("merge plan.json parts/1.ply parts/0.ply -o again.ply");
    assert!(fs::read(work.path("whole.ply")).unwrap() == fs::read(work.path("again.ply")).unwrap());
    // A part is augmented as any scene.
    work.ok("enhance plan.json --part 0 --base parts/0.ply -o more.ply --ratio 0.1");
    assert!(
        work.json("merge plan.json more.ply parts/1.ply -o more-whole.ply --json")["gaussians"].as_u64() > Some(kept)
    );
}

#[test]
fn a_plan_is_shown_from_above_with_the_sizes_of_its_parts() {
    let work = planned();
    work.ok("report plan.json -o page");
    assert_eq!(files(&work.path("page")), ["index.html"]);
    let page = fs::read_to_string(work.path("page/index.html")).unwrap();
    // A wedge for each of seven training photos and two test photos, in three colors; a row for each of two parts.
    assert_eq!([page.matches("<polygon").count(), page.matches("class=\"key\"").count()], [9, 2]);
    let colors: std::collections::BTreeSet<&str> =
        page.split("<polyline").skip(1).map(|line| &line[line.find("stroke=").unwrap()..][..15]).collect();
    assert_eq!(colors.len(), 3, "{colors:?}");
    let text = fs::read_to_string(work.path("data/sparse/0/points3D.txt")).unwrap();
    let points = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).count();
    let cell =
        |row: &str, column: usize| row.split("<td>").nth(column).unwrap().split('<').next().unwrap().parse::<usize>();
    let rows: Vec<&str> = page.split("class=\"key\"").skip(1).collect();
    let sum = |column: usize| rows.iter().map(|row| cell(row, column).unwrap()).sum::<usize>();
    assert_eq!([sum(1), sum(4)], [7, points]);
    assert!(!page.contains("http"));
    work.refused("report data -o other", &["data", "not a plan"]);
    for option in ["--part 0", "--max-size 16", "--holdout 3", "--compensate", "--split train", "--device 0"] {
        work.misused(&format!("report plan.json -o other {option}"), "<NAME=SCENE>");
    }
    work.refused("report plan.json -o page", &["already exists"]);
}

#[test]
fn what_is_no_part_of_the_plan_is_refused() {
    let work = planned();
    work.refused("train plan.json -o a.ply", &["plan.json", "2 parts", "--part"]);
    work.refused("train plan.json --part 2 -o a.ply", &["plan.json", "parts 0 to 1"]);
    work.refused("train data/sparse/0/points3D.txt --part 0 -o a.ply", &["points3D.txt", "not a plan"]);
    work.refused("train plan.json --part 0 --max-size 16 -o a.ply", &["plan.json", "--max-size"]);
    work.refused("train plan.json --part 0 --exposure -o a.ply", &["--exposure"]);
    work.refused("partition plan.json --part 0 -o b.json --photos 2", &["not cut again"]);
    work.refused("partition data -o plan.json --photos 4", &["already exists"]);
    work.refused("merge plan.json data -o a.ply", &["data", "no PLY files"]);
    // Another dataset under the plan's path.
    let points = work.path("data/sparse/0/points3D.txt");
    let text = fs::read_to_string(&points).unwrap();
    fs::write(&points, text.replacen("1 ", "1 -", 1).replacen("--", "", 1)).unwrap();
    work.refused("train plan.json --part 0 -o a.ply", &["plan.json", "other photos, cameras or points"]);
}
