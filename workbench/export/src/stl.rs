// SPDX-License-Identifier: GPL-2.0-or-later
//! STL files in text form as binary ones, because MuJoCo reads only those.

/// Returns whether an STL file is binary: its length follows from its number of triangles.
pub fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(80..84).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    count.is_some_and(|count| bytes.len() as u64 == 84 + 50 * u64::from(count))
}

/// Returns the triangles of a file in text form as a binary file; `None` if it has none, or one that is not complete.
pub fn binary(bytes: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(bytes).ok()?;
    let first = text.split_ascii_whitespace().next()?;
    let mut vertices: Vec<[f32; 3]> = vec![];
    // Only first words of lines are keywords: a solid may be named "vertex".
    for line in text.lines().map(str::trim_start) {
        let mut words = line.split_ascii_whitespace();
        if words.next().is_some_and(|word| word.eq_ignore_ascii_case("vertex")) {
            let mut next = || words.next()?.parse().ok().filter(|value: &f32| value.is_finite());
            vertices.push([next()?, next()?, next()?]);
        }
    }
    let (triangles, []) = vertices.as_chunks::<3>() else { return None };
    if triangles.is_empty() || !first.eq_ignore_ascii_case("solid") {
        return None;
    }
    let mut file = vec![0; 80];
    file.extend(u32::try_from(triangles.len()).ok()?.to_le_bytes());
    for triangle in triangles {
        // Readers compute the normal from the vertices where it is 0.
        file.extend([0; 12]);
        triangle.iter().flatten().for_each(|value| file.extend(value.to_le_bytes()));
        file.extend([0; 2]);
    }
    Some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "solid a vertex of things\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1e1 0 0\n   \
                        VERTEX 0 -2.5 0.125\n  endloop\n endfacet\nendsolid a\n";

    #[test]
    fn a_file_in_text_form_becomes_binary() {
        let file = binary(TEXT.as_bytes()).expect("a triangle");
        assert!(is_binary(&file) && !is_binary(TEXT.as_bytes()));
        let values: Vec<f32> =
            file[96..132].chunks(4).map(|v| f32::from_le_bytes(v.try_into().unwrap())).collect();
        assert_eq!(values, [0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0, -2.5, 0.125]);
    }

    #[test]
    fn a_file_without_whole_triangles_has_no_binary_form() {
        for text in [
            String::new(),
            "solid a\nendsolid a\n".into(),
            TEXT.replace("   vertex 0 0 0\n", ""),
            TEXT.replace("1e1", "wide"),
            TEXT.replace("1e1", "inf"),
            TEXT.replacen("solid", "shape", 1),
        ] {
            assert_eq!(binary(text.as_bytes()), None, "{text}");
        }
        assert_eq!(binary(&[0xff; 90]), None);
    }
}
