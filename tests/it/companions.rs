//! What stands beside the pictures is what the edge into `audio` says; and which encoder writes them, by wish.

use crate::support::clips::{make, packet_sums, probe, shaky, workshop};
use crate::support::program::{err, plumbline_in, succeed};

const HEAD: &str = "version = 1\n[stage.a]\nuse = \"video.decode\"\npath = \"a.mkv\"\n";

fn kinds(path: &std::path::Path) -> Vec<String> {
    let text = probe(path, &["-show_entries", "stream=codec_type", "-of", "csv=p=0"]);
    text.lines().map(str::to_owned).collect()
}

#[test]
fn sound_comes_from_where_the_edge_says_and_from_nowhere_without_one() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let coded = "-c:v libx264 -preset ultrafast -pix_fmt yuv420p -c:a libopus -shortest";
    let tone = |hertz: u32| format!("{} -f lavfi -i sine=frequency={hertz}:duration=0.4 {coded}", shaky(0.4));
    let a = make(folder, "a.mkv", &format!("{} -metadata title=first", tone(440)));
    let b = make(folder, "b.mkv", &format!("{} -metadata title=second", tone(880)));
    let title = |path: &std::path::Path| {
        probe(path, &["-show_entries", "format_tags=title", "-of", "csv=p=0"]).trim().to_owned()
    };
    for (name, other, edge, sound, tag) in [
        ("own", "", ", audio = \"a.audio\"", Some(&a), "first"),
        ("none", "", "", None, ""),
        ("other", "[stage.b]\nuse = \"video.decode\"\npath = \"b.mkv\"\n", ", audio = \"b.audio\"", Some(&b), "second"),
    ] {
        let encode =
            format!("inputs = {{ frames = \"a.frames\"{edge} }}\npath = \"{name}.mkv\"\npreset = \"ultrafast\"\n");
        let file = format!("{HEAD}{other}[stage.out]\nuse = \"video.encode\"\n{encode}");
        std::fs::write(folder.join("job.toml"), file).expect("a small file");
        succeed(folder, &["run", "job.toml"]);
        let result = folder.join(format!("{name}.mkv"));
        let expected = if sound.is_some() { vec!["video", "audio"] } else { vec!["video"] };
        assert_eq!(kinds(&result), expected, "{name}");
        assert_eq!(title(&result), tag, "{name}");
        if let Some(sound) = sound {
            assert_eq!(packet_sums(&result, "a"), packet_sums(sound, "a"), "{name}");
        }
    }
}

#[test]
fn an_encoder_that_is_not_there_is_refused_before_any_work_and_auto_does_without() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "a.mp4", &format!("{} -c:v libx264 -preset ultrafast -pix_fmt yuv420p", shaky(0.4)));
    let works = !plumbline::media::encoders(plumbline::media::Codec::H264).iter().all(|e| !e.hardware);
    for (wish, refused, message) in [
        ("h264_magic", true, "no encoder for h264_magic: this FFmpeg was built without it; available: libx264"),
        ("a b", true, "`a b` is no encoder (expected software, auto, hardware, or FFmpeg's name of one)"),
        (
            "hardware",
            !works,
            "no encoder for h264 on a device: no device for it works on this machine (tried h264_nvenc",
        ),
        ("auto", false, "h264"),
        ("libx264", false, "libx264"),
    ] {
        let args = ["stabilize", "a.mp4", "-o", "out.mp4", "--encoder", wish, "--overwrite", "--progress", "plain"];
        let ran = plumbline_in(folder, &args);
        assert_eq!(ran.status.code(), Some(if refused { 2 } else { 0 }), "{wish}: {}", err(&ran));
        assert!(!refused || err(&ran).contains(message), "{wish}: {}", err(&ran));
        assert!(!refused || !err(&ran).contains("frames,"), "{wish}: before any work: {}", err(&ran));
        assert!(refused || works || err(&ran).contains("libx264"), "{wish}: {}", err(&ran));
    }
}

#[test]
fn fields_without_a_flag_are_detected_and_separated_on_request() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let coded = "-c:v ffv1 -pix_fmt yuv420p";
    // Fields see a shake of low frequencies only, or their order could not be told.
    let slow = ["1.9", "0.77", "2.3", "0.61"].iter().fold(shaky(2.4), |s, w| s.replace(w, &format!("0.2*{w}")));
    make(folder, "woven.mkv", &format!("{slow} -vf tinterlace=interleave_bottom,setfield=prog {coded}"));
    make(folder, "whole.mkv", &format!("{} {coded}", shaky(1.2)));
    let deinterlace = |name: &str, how: &str| {
        let args = ["stabilize", name, "-o", "out.mkv", "--codec", "ffv1", "--overwrite", "--deinterlace", how];
        err(&succeed(folder, &args))
    };
    let told = deinterlace("woven.mkv", "auto");
    assert!(told.contains("the pictures look interlaced, the bottom field first"), "{told}");
    let told = deinterlace("woven.mkv", "bottom");
    assert!(told.contains("interlaced frames: 30, deinterlaced") && !told.contains("look interlaced"), "{told}");
    let told = deinterlace("whole.mkv", "auto");
    assert!(!told.contains("interlaced"), "{told}");
}
