"""Driver `inverse3`: Haply's Inverse3, through the maker's own service."""
