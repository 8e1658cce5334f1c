"""How stiff a surface a device in space can hold, by direction and place, exactly; and whether stepping agrees."""
