//! Tests OpenUSD's text form, and archives of it.

use super::*;

/// A stage around the body of its root, with one Gaussian for each row of `positions`.
fn stage(head: &str, body: &str) -> Vec<u8> {
    format!("#usda 1.0\n(\n{head}\n)\n{body}\n").into_bytes()
}

/// Two Gaussians of degree 1, with what other writers add.
const TWO: &str = r#"
def "Unused" {
    custom string note = "a \"quoted\" ( bracket"
    asset file = @./other.usd@
    rel material:binding = </World/Looks>
}
def Xform "World" (
    kind = "component" # ( in a comment
)
{
    double3 xformOp:translate = (10, 0, 0)
    float3 xformOp:rotateXYZ = (0, 90, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]

    def ParticleField3DGaussianSplat "splat" (
        customData = { dictionary other = { int glints = 4 }; string glint = "{\"max_size\": 400}" }
    )
    {
        point3f[] positions = [(1, 2, 3), (0, 0, -1),]
        quath[] orientationsh = [(1, 0, 0, 0), (0, 1, 0, 0)]
        float3[] scales = [(1, 1, 1), (0.5, 2, 1)] ( interpolation = "vertex" )
        float[] opacities = [0.5, 1, 7]
        uniform int radiance:sphericalHarmonicsDegree = 1
        float3[] radiance:sphericalHarmonicsCoefficients = [
            (0.1, 0.2, 0.3), (1, 0, 0), (0, 1, 0), (0, 0, 1),
            (0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)
        ]
    }
}
"#;

#[test]
fn a_stage_of_another_program_is_read_under_its_transformations() {
    let file = read("a.usda", &stage("upAxis = \"Y\"", TWO)).unwrap();
    let base = &file.scene.base;
    assert_eq!((base.len(), base.sh_degree, file.trained_with.max_size), (2, 1, Some(400)));
    // A quarter turn about y takes (1, 2, 3) to (3, 2, −1); then 10 along x; then y and z change signs.
    assert!(near(base.means.as_flattened(), &[13.0, -2.0, 1.0, 9.0, 0.0, 0.0]), "{:?}", base.means);
    assert!(near(&base.log_scales[1], &[0.5f32.ln(), 2f32.ln(), 0.0]) && base.opacities[0] == 0.0);
    // Opaque, and the third opacity belongs to nobody.
    assert!(base.opacities.len() == 2 && base.opacities[1] > 15.0);
    assert!(near(&base.sh[0], &[0.1, 0.2, 0.3]));
    // With z up, (x, y, z) of the stage is (x, −z, y) of a PLY.
    let up = read("a.usda", &stage("upAxis = \"Z\"", TWO)).unwrap().scene.base;
    assert!(near(&up.means[0], &[13.0, 1.0, 2.0]), "{:?}", up.means);
}

#[test]
fn what_is_missing_has_the_schemas_defaults_and_what_is_short_is_ignored() {
    let one = "def ParticleField3DGaussianSplat \"s\" { point3h[] positionsh = [(1, 2, 3)] }";
    let base = read("a.usda", &stage("", one)).unwrap().scene.base;
    assert_eq!((base.means[0], base.log_scales[0], base.sh_degree), ([1.0, -2.0, -3.0], [0.0; 3], 0));
    assert!(base.quats[0] == [1.0, 0.0, 0.0, 0.0] && base.opacities[0] > 15.0 && base.sh == [[0.0; 3]]);
    let file = read("a.usda", &stage("", &one.replace("}", "float3[] scales = [(1, 1)] }"))).unwrap();
    assert_eq!(
        (file.scene.base.log_scales[0], file.notes),
        ([0.0; 3], vec!["`scales` has 2 numbers of 3, so it is ignored".to_owned()])
    );
    // Two prims are one scene.
    let both = format!("{one}\n{}", TWO);
    assert_eq!(read("a.usda", &stage("", &both)).unwrap().scene.base.len(), 3);
}

#[test]
fn damage_is_an_error_with_its_line() {
    let splat = "def ParticleField3DGaussianSplat \"s\" {";
    for (body, words) in [
        ("def Mesh \"m\" {}", "has no prim `ParticleField3DGaussianSplat`"),
        ("def Xform \"x\" {", "a brace is not closed"),
        ("def Xform \"x {}", "line 5: a string is not closed"),
        (&format!("{splat} }}"), "prim `s`: lacks `positions`"),
        (&format!("{splat} point3f[] positions.timeSamples = {{ 0: [(1, 2, 3)] }} }}"), "is animated"),
        (&format!("{splat} point3f[] positions = [(1, 2, x)] }}"), "`positions`: `x` is not a number"),
        (&format!("{splat} point3f[] positions = [(1, 2, 3) }}"), "a bracket is not closed"),
        (&format!("{splat} point3f[] positions = [(nan, 2, 3)] }}"), "row 0"),
        (
            &format!("{splat} point3f[] positions = [(1, 2, 3)] uniform int radiance:sphericalHarmonicsDegree = 4 }}"),
            "expected 0 to 3",
        ),
        (
            &TWO.replace("(0, 90, 0)", "(0, 90)"),
            "prim `World`: `xformOp:rotateXYZ` is not a transformation that is read",
        ),
        (
            &TWO.replace("float3 xformOp:rotateXYZ = (0, 90, 0)", "float3 xformOp:scale = (1, 2, 1)")
                .replace("\"xformOp:rotateXYZ\"", "\"xformOp:scale\""),
            "no rotation, uniform scale and translation",
        ),
    ] {
        refused("a.usda", &stage("", body), &[words]);
    }
    refused("a.usda", &[b"#usda 1.0\n\xff"[..].to_vec()].concat(), &["is not UTF-8 at byte 10"]);
    let deep = "def \"a\" {\n".repeat(100) + &"}".repeat(100);
    refused("a.usda", &stage("", &deep), &["nested deeper than 64"]);
    refused("b.usdc", b"PXR-USDC\0\0\0\0", &["OpenUSD scene in binary form", "usdcat"]);
}

/// Offsets by APPNOTE.TXT of PKWARE: method at 8, time and date at 10, sizes at 18 and 22, lengths of name and other fields at 26 and 28.
#[test]
fn a_usdz_is_the_usda_uncompressed_at_a_multiple_of_64_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let trained_with = TrainedWith { max_size: Some(400), ..Default::default() };
    let scene = Scene { origin: glam::DVec3::new(5e5, 4.5e6, -120.125), ..sample(12, 50, 2) };
    let written = |name: &str| {
        let path = folder.path().join(name);
        assert_eq!(write_scene_file(&path, &SceneFile { trained_with, ..scene.clone().into() }).unwrap(), [""; 0]);
        (read_scene_file(&path).unwrap(), fs::read(&path).unwrap())
    };
    let ((text, usda), (archive, usdz)) = (written("a.usda"), written("a.usdz"));
    assert_eq!(text, archive);
    let number =
        |at: usize, bytes: usize| usdz[at..at + bytes].iter().rev().fold(0, |all, &byte| all << 8 | usize::from(byte));
    let begin = 30 + number(26, 2) + number(28, 2);
    assert_eq!((begin % 64, number(8, 2), &usdz[30..30 + number(26, 2)]), (0, 0, &b"scene.usda"[..]));
    // OpenUSD takes sizes from here, so none may follow the data (flag 8). The date is 1 January 1980.
    assert_eq!([number(18, 4), number(22, 4), number(6, 2) & 8, number(10, 4)], [usda.len(), usda.len(), 0, 0x21_0000]);
    assert!(usdz[begin..begin + usda.len()] == usda);
}

#[test]
fn the_first_file_of_a_usdz_is_read() {
    let (layer, other) = (stage("", TWO), stage("", "def Mesh \"m\" {}"));
    // A name beyond the bytes that decide a file's kind is known by the whole file.
    for name in ["a.usda", "folder/b.usd", &format!("{}.usda", "long".repeat(500))] {
        let bytes = archive(&[(name, &layer), ("0.png", b"a texture"), ("other.usda", &other)]);
        assert_eq!(read("a.usdz", &bytes).unwrap(), read("a.usda", &layer).unwrap());
        assert_eq!(read("a.zip", &bytes).unwrap().scene.base.len(), 2);
    }
    refused(
        "a.usdz",
        &archive(&[("other.usda", &other), ("a.usda", &layer)]),
        &["`other.usda` in the archive: has no prim"],
    );
}

#[test]
fn damaged_usdz_and_binary_layers_are_errors() {
    let binary = archive(&[("a.usdc", b"PXR-USDC\0\0\0\0"), ("b.usda", &stage("", TWO))]);
    refused("a.usdz", &binary, &["its first file `a.usdc` is an OpenUSD scene in binary form", "usdcat"]);
    refused("a.usdz", &archive(&[("a.usd", b"")]), &["`a.usd` is empty, expected OpenUSD as text"]);
    refused(
        "a.usdz",
        &archive(&[("a.usda", &stage("", "def \"x\" {"))]),
        &["`a.usda` in the archive: line", "not closed"],
    );
    refused("a.usdz", &archive(&[("a.usda", &vec![b' '; 4 << 20])]), &["promises 4194304 bytes of `a.usda`"]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.usdz");
    write_scene_file(&path, &SceneFile::from(sample(13, 2, 0))).unwrap();
    damage("a.usdz", &fs::read(&path).unwrap(), |_| false);
}
