//! OpenEXR files of 32-bit floats, for maps of positions.

use std::io::{self, Seek, Write};

use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
};

/// Writes channels of `width × height` values each, row by row, losslessly compressed.
///
/// # Errors
/// Those of `out`; a channel of another length.
pub fn write_exr(
    (width, height): (usize, usize),
    channels: [(&str, Vec<f32>); 2],
    out: impl Write + Seek,
) -> io::Result<()> {
    if channels.iter().any(|(_, values)| values.len() != width * height) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "a channel needs one value per pixel"));
    }
    let channel = |(name, values): (&str, Vec<f32>)| AnyChannel::new(name, FlatSamples::F32(values));
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
    let channels = AnyChannels::sort(channels.into_iter().map(channel).collect());
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let written = Image::from_layer(layer).write().non_parallel().to_unbuffered(out);
    written.map_err(|e| match e {
        exr::error::Error::Io(e) => e,
        other => io::Error::other(other.to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers};
    use std::io::Cursor;

    #[test]
    fn every_value_comes_back_to_the_bit_under_its_name() {
        let (width, height) = (37, 21);
        let values = |scale: f32| (0..width * height).map(|i| scale * (i as f32).sin()).collect::<Vec<f32>>();
        let mut file = Cursor::new(Vec::new());
        write_exr((width, height), [("R", values(0.3)), ("G", values(-7.0))], &mut file).expect("memory");
        assert_eq!(file.get_ref()[..4], [0x76, 0x2f, 0x31, 0x01], "the magic number of the format");
        let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
        let image = read.all_attributes().from_buffered(Cursor::new(file.into_inner())).expect("a valid file");
        assert_eq!(image.layer_data.size.0, width);
        for (name, expected) in [("R", values(0.3)), ("G", values(-7.0))] {
            let channels = &image.layer_data.channel_data.list;
            let channel = channels.iter().find(|c| c.name.eq(name)).expect(name);
            assert_eq!(channel.sample_data.values_as_f32().collect::<Vec<_>>(), expected);
        }
        assert!(write_exr((2, 2), [("R", vec![0.0; 4]), ("G", vec![0.0; 3])], Cursor::new(Vec::new())).is_err());
    }
}
