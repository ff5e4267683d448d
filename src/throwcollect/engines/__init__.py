"""Physics engines: what one is (`engine`) and those that come with the product."""
