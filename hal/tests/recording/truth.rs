//! Truth beside the pictures, and everything that can be wrong with it.

use fencepost_hal::calibration::LidarCalibration;
use fencepost_hal::recording::TrueDisparity;

use super::*;

fn sweep_bytes(points: &[[f32; 4]]) -> Vec<u8> {
    points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn sweeps_are_read_point_by_point() {
    let folder = kitti("sweep");
    assert_eq!(folder.open().unwrap().truth.sweep_of(0), Ok(None), "no folder");
    fs::create_dir(folder.join("velodyne")).unwrap();
    let bytes = sweep_bytes(&[[1.5, -2.25, 0.125, 0.9], [40.0, 3.0, -1.75, 0.0]]);
    fs::write(folder.join("velodyne/000001.bin"), &bytes).unwrap();
    fs::write(folder.join("velodyne/000002.bin"), &bytes[..bytes.len() - 1]).unwrap();
    fs::write(folder.join("velodyne/000003.bin"), b"").unwrap();
    let truth = folder.open().unwrap().truth;
    assert_eq!(truth.sweep_of(0), Ok(None), "no file of this frame");
    assert_eq!(truth.sweep_of(1), Ok(Some(vec![[1.5, -2.25, 0.125], [40.0, 3.0, -1.75]])));
    assert_eq!(truth.sweep_of(3), Ok(Some(vec![])));
    let error = truth.sweep_of(2).unwrap_err();
    assert_eq!(error.frame(), Some(2));
    let text = error.to_string();
    assert!(text.contains("000002.bin") && text.contains("31 bytes") && text.contains("; it is cut off"), "{text}");
}

#[test]
fn true_disparity_is_read_as_it_is_and_must_have_16_bits() {
    let folder = kitti("true-disparity");
    fs::create_dir(folder.join("disp_occ_0")).unwrap();
    let values: Vec<u16> = (0..12).map(|i| i * 5000).collect();
    let deep = ImageBuffer::<Luma<u16>, Vec<u16>>::from_raw(4, 3, values.clone()).unwrap();
    deep.save(folder.join("disp_occ_0/000000.png")).unwrap();
    ImageBuffer::<Luma<u8>, _>::from_pixel(4, 3, Luma([7])).save(folder.join("disp_occ_0/000001.png")).unwrap();
    fs::write(folder.join("disp_occ_0/000002.png"), b"a letter").unwrap();
    let truth = folder.open().unwrap().truth;
    assert_eq!(truth.disparity_of(0), Ok(Some(TrueDisparity { width: 4, height: 3, pixels: values })));
    assert_eq!(truth.disparity_of(3), Ok(None));
    let shallow = truth.disparity_of(1).unwrap_err();
    assert!(matches!(shallow, RecordingError::BadTruth { frame: 1, .. }), "{shallow}");
    assert!(shallow.to_string().contains("is not grey with 16 bits; "), "{shallow}");
    assert!(matches!(truth.disparity_of(2), Err(RecordingError::BadPicture { frame: 2, .. })));
}

#[test]
fn the_lidar_is_read_in_double_precision() {
    let folder = kitti("lidar");
    assert_eq!(LidarCalibration::read(&folder.0), Ok(None), "no Tr");
    let p0 = "P0: 721.5377123456 0 609.5593 0 0 721.5377123456 172.854 0 0 0 1 0\n";
    let p1 = "P1: 721.5377123456 0 609.5593 -387.5744 0 721.5377123456 172.854 0 0 0 1 0\n";
    folder.write("calib.txt", &format!("{p0}{p1}Tr: 0 -1 0 0.25 0 0 -1 -0.5 1 0 0 -0.75\n"));
    let lidar = LidarCalibration::read(&folder.0).unwrap().unwrap();
    assert_eq!((lidar.focal_px, lidar.cx, lidar.cy), (721.5377123456, 609.5593, 172.854));
    assert_eq!(lidar.baseline_m, 387.5744 / 721.5377123456);
    assert_eq!(lidar.to_camera, [[0.0, -1.0, 0.0, 0.25], [0.0, 0.0, -1.0, -0.5], [1.0, 0.0, 0.0, -0.75]]);
    for (text, field, says) in [
        (format!("{p0}{p1}Tr: 1 0 0\n"), "Tr", "3x4"),
        (format!("{p0}{p1}Tr: 0 -1 0 x 0 0 -1 0 1 0 0 0\n"), "Tr", "not a number"),
        (format!("{p0}Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n"), "P1", "missing"),
        (format!("{}{p1}Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n", p0.replace("721", "-721")), "P0", "focal length"),
    ] {
        folder.write("calib.txt", &text);
        let error = LidarCalibration::read(&folder.0).unwrap_err();
        assert_eq!(error.field, field, "{text}");
        assert!(error.to_string().contains(says), "{error}");
    }
    fs::remove_file(folder.join("calib.txt")).unwrap();
    assert_eq!(LidarCalibration::read(&folder.0), Ok(None));
}
