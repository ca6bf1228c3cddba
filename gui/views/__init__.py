"""Views: pictures and maps in dockable windows."""
