//! The checks of groups and fields, the same for sheets and solids.

use super::{Field, Group, MeshError};

/// Checks groups over `count` vertices, triangles or cells: members ascend, exist, and no two groups have one name.
pub(super) fn check_groups(groups: &[Group], count: usize) -> Result<(), MeshError> {
    for (index, Group { name, members }) in groups.iter().enumerate() {
        let mut least = 0_u64;
        for (position, &found) in members.iter().enumerate() {
            if u64::from(found) < least || found as usize >= count {
                return Err(MeshError::GroupMember {
                    name: name.clone(),
                    position,
                    found,
                    count,
                });
            }
            least = u64::from(found) + 1;
        }
        if groups
            .iter()
            .take(index)
            .any(|earlier| earlier.name == *name)
        {
            return Err(MeshError::GroupName { name: name.clone() });
        }
    }
    Ok(())
}

/// Checks fields over `count` triangles or cells: one finite value each, and no two fields have one name.
pub(super) fn check_fields(fields: &[Field], count: usize) -> Result<(), MeshError> {
    for (index, Field { name, values }) in fields.iter().enumerate() {
        if values.len() != count {
            return Err(MeshError::FieldLength {
                name: name.clone(),
                found: values.len(),
                count,
            });
        }
        let mut numbered = values.iter().enumerate();
        if let Some((position, &found)) = numbered.find(|(_, value)| !value.is_finite()) {
            return Err(MeshError::FieldValue {
                name: name.clone(),
                position,
                found,
            });
        }
        if fields
            .iter()
            .take(index)
            .any(|earlier| earlier.name == *name)
        {
            return Err(MeshError::FieldName { name: name.clone() });
        }
    }
    Ok(())
}
